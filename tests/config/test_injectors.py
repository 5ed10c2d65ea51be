"""Several injectors, and several buses, in a bench file: what they share, which mistakes are refused, and where."""

from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench
from observer_rt.config.bench_file import BusesConfig, values_by_bus
from observer_rt.foundation.errors import UserError
from tests.config.test_bench import bench_file, require_bench_refusal
from tests.three_injectors import NAMES, RATE_ID, STEP, one_alone, three_injectors
from tests.two_injectors import BOTH, one_injector, two_injectors

ROOT = Path(__file__).parents[1]
THREE = (ROOT / "bus" / "databases" / "three_buses.toml").read_text()


def test_an_injector_is_read_as_if_it_were_alone(tmp_path: Path) -> None:
    bench = load_bench(two_injectors(tmp_path))
    assert [injector.name for injector in bench.injectors] == ["left", "right"]
    for number, injector in enumerate(bench.injectors, 1):
        alone = load_bench(one_injector(tmp_path, injector.name, number))
        assert (alone.injector.config, alone.config) == (injector.config, bench.config)
        assert alone.injector.name == ""


def test_what_is_left_out_is_as_at_the_top_key_by_key(tmp_path: Path) -> None:
    text = '[injectors.left.learning]\nevent_gap_ms = 5\n[injectors.left.state]\nfile = "left.json"\n'
    left, right = load_bench(two_injectors(tmp_path, text)).injectors
    assert (left.config.learning.event_gap_ms, left.config.learning.lockstep) == (5.0, True)
    assert (right.config.learning.event_gap_ms, right.config.learning.lockstep) == (8.0, True)
    assert (left.state, right.state) == (tmp_path / "left.json", None)


def test_each_has_its_own_model(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(NOMINAL_INJECTOR.read_text().replace("holes = 8", "holes = 7"))
    path = two_injectors(tmp_path, '[injectors.right.model]\nfile = "mine.toml"\n')
    assert [injector.parameters.nozzle.holes for injector in load_bench(path).injectors] == [8, 7]


def test_where_one_is_asked_for_the_others_are_left_out(tmp_path: Path) -> None:
    bench = load_bench(two_injectors(tmp_path))
    with pytest.raises(UserError, match=r"(?s)2 injectors, this is for one: left, right.*--injector left"):
        _ = bench.injector
    assert bench.of("right").injector == bench.injectors[1]
    assert [each.injector for each in bench.per_injector] == list(bench.injectors)
    assert bench.of(None) == bench
    with pytest.raises(UserError, match="did you mean 'right'"):
        bench.of("rihgt")
    with pytest.raises(UserError, match="the file has one injector"):
        load_bench(one_injector(tmp_path, "left", 1)).of("left")


def test_names_and_identifiers_by_rule(tmp_path: Path) -> None:
    """As each of them by itself, where nothing is by rule; what an injector states of its own comes first."""
    path = three_injectors(tmp_path, "can0")
    for number, injector in enumerate(load_bench(path).injectors):
        alone = load_bench(one_alone(tmp_path, number, "can0")).injector.config
        assert (injector.config.signals, injector.config.outputs) == (alone.signals, alone.outputs)
        assert injector.state == tmp_path / f"learned_{NAMES[number]}.json"
    path.write_text(path.read_text() + "[injectors.three.outputs]\nstatus_id = 7\ninjector_id = 9\n")
    *_, third = load_bench(path).injectors
    assert (third.config.outputs.status_id, third.config.outputs.injector_id) == (7, 9)
    assert third.config.outputs.injection_rate_id == RATE_ID + 2 * STEP


@pytest.mark.parametrize("outputs", ["id_step = 16", "id_step = 0\nstatus_id = 5", "id_step = 1\nstatus_id = 'a'"])
def test_a_step_needs_a_first_identifier(tmp_path: Path, outputs: str) -> None:
    require_bench_refusal(tmp_path, BOTH + f"[outputs]\n{outputs}\n", "outputs.id_step", "all whole numbers")


WRONG = {
    "injectors.left.output": ("[injectors.left.outputs]", "did you mean 'outputs'?"),
    "injectors.right.outputs.injecter_id = 3": ("injector_id = 2", "did you mean 'injector_id'?"),
    "injectors.left.signals.needle_lift.link = 'lft'": ('link = "left"', "did you mean 'left'?"),
    "learning.event_gap = 8": ("event_gap_ms = 8", "did you mean 'event_gap_ms'?"),
    "learning.event_gap_ms = 0": ("event_gap_ms = 8", "should be greater than or equal to 2"),
    "injectors.left.link": ("[injectors.left.signals.line_pressure]", "unknown key"),
    "injectors.a b": ("[injectors.right.signals.needle_lift]", "is not allowed"),
    "samplin": ("[sampling]", "did you mean 'sampling'?"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_mistakes_are_named_where_they_are(tmp_path: Path, wrong: str) -> None:
    """wrong: the place, with the value there or, without one, as a section."""
    old, said = WRONG[wrong]
    location, _, value = wrong.partition(" = ")
    key = location.rpartition(".")[2]
    new = f"{key} = {value}" if value else "[" + location.replace("a b", "'a b'") + "]"
    assert old in BOTH
    require_bench_refusal(tmp_path, BOTH.replace(old, new), location, said)


def test_a_role_that_an_injector_has_not_is_missed(tmp_path: Path) -> None:
    text = BOTH[: BOTH.index("[injectors.right.signals.line_pressure]")]
    require_bench_refusal(tmp_path, text, "signals.line_pressure", "is missing add it")


def buses_of(folder: Path, text: str) -> BusesConfig:
    return load_bench(bench_file(folder, text)).config


def test_what_a_further_bus_leaves_out_is_as_in_the_first(tmp_path: Path) -> None:
    text = THREE.replace('channel = "can2"', 'channel = "can2"\nfd = false\nbit_rate = 250e3')
    buses = buses_of(tmp_path, text).buses
    assert [bus.label for bus in buses] == ["can0", "lift (can1)", "line (can2)", "results (can3)"]
    assert [bus.config.bit_rate for bus in buses] == [1e6, 1e6, 250e3, 1e6]
    assert [bus.config.fd for bus in buses] == [True, True, False, True]
    assert {bus.config.interface for bus in buses} == {"socketcan"}


LOST = '[signals.{}]\nmessage = "X"\nsignal = "Y"\nlink = "lin"\n[outputs]'
LATE = LOST.format("energizing").replace('link = "lin"', "missing_after_ms = 51")


@pytest.mark.parametrize(
    ("old", "new", "location", "said"),
    [
        ('link = "lift"', 'link = "lfit"', "signals.needle_lift.link", "did you mean 'lift'?"),
        ('link = "results"', 'link = "result"', "outputs.link", "did you mean 'results'?"),
        ('"observer_fd.dbc"', '"observer_fd.dbc"\nlink = "lien"', "dbc.0.link", "did you mean 'line'?"),
        ('channel = "can2"', 'channel = "can1"', "links.line.channel", "as that of [links.lift]"),
        ('channel = "can2"', 'chanel = "can2"', "links.line.chanel", "did you mean 'channel'?"),
        ('[links.line]\nchannel = "can2"', "[links.line]\nfd = true", "links.line.channel", "is missing"),
        ("[links.line]", '[links."a b"]', "links.a b", "is not allowed"),
        ("[[dbc]]", "[dbc]", "dbc", "should be [[dbc]], with two brackets"),
        ("[outputs]", "[realtime]\ncpus = 3\n[outputs]", "realtime.cpus", "should be a list in brackets"),
        ('link = "results"', "link = { a = 1 }", "outputs.link", "should be a text in quotes"),
        ("[outputs]", LOST.format("learning_enable"), "signals.learning_enable.link", "did you mean 'line'?"),
        ("[outputs]", LOST.format("energizing"), "signals.energizing.link", "did you mean 'line'?"),
        ("[outputs]", LATE, "signals.energizing.missing_after_ms", "should be less than or equal to 50"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, location: str, said: str) -> None:
    assert old in THREE
    require_bench_refusal(tmp_path, THREE.replace(old, new), location, said)


def test_a_link_where_there_are_none(tmp_path: Path) -> None:
    text = load_bench().path.read_text().replace('"observer_fd.dbc"', '"observer_fd.dbc"\nlink = "lift"')
    with pytest.raises(UserError, match=r"there is no link 'lift'(.|\n)*add \[links.lift\] with its channel"):
        buses_of(tmp_path, text)


def test_an_option_for_each_bus() -> None:
    buses = BusesConfig.model_validate({"links": {"lift": {"channel": "can1"}}, "dbc": [{"file": "x"}]}).buses
    assert values_by_bus("--channel", ["vcan0", "lift=vcan1", "vcan7"], buses) == {0: "vcan7", 1: "vcan1"}
    with pytest.raises(UserError, match=r"--channel lfit=vcan1: there is no link 'lfit'(.|\n)*'lift'"):
        values_by_bus("--channel", ["lfit=vcan1"], buses)


def test_with_one_bus_a_channel_may_hold_an_equals_sign() -> None:
    assert values_by_bus("--channel", ["socket://a?b=c"], load_bench().config.buses) == {0: "socket://a?b=c"}
