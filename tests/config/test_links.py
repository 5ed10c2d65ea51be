"""Several buses in a bench file: defaults, refusals, and options of the command line."""

from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.config.bench_file import BusesConfig, of_links
from observer_rt.foundation.errors import UserError
from tests.config.test_bench import bench_file, bench_refusal

ROOT = Path(__file__).parents[1]
THREE = (ROOT / "bus" / "databases" / "three_buses.toml").read_text()


def buses_of(folder: Path, text: str) -> BusesConfig:
    return load_bench(bench_file(folder, text)).config


def test_a_bench_with_one_link_has_one_bus() -> None:
    (bus,) = load_bench().config.buses
    assert (bus.name, bus.label, bus.location) == ("", "can0", "link")
    assert bus.config == load_bench().config.link


def test_what_a_further_bus_leaves_out_is_as_in_the_first(tmp_path: Path) -> None:
    text = THREE.replace('channel = "can2"', 'channel = "can2"\nfd = false\nbit_rate = 250e3')
    buses = buses_of(tmp_path, text).buses
    assert [bus.label for bus in buses] == ["can0", "lift (can1)", "line (can2)", "results (can3)"]
    assert [bus.config.bit_rate for bus in buses] == [1e6, 1e6, 250e3, 1e6]
    assert [bus.config.fd for bus in buses] == [True, True, False, True]
    assert {bus.config.interface for bus in buses} == {"socketcan"}


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
        (
            "[outputs]",
            '[signals.learning_enable]\nmessage = "X"\nsignal = "Y"\nlink = "lin"\n[outputs]',
            "signals.learning_enable.link",
            "did you mean 'line'?",
        ),
    ],
)
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, location: str, said: str) -> None:
    assert old in THREE
    error = bench_refusal(tmp_path, THREE.replace(old, new))
    assert error.location.endswith(f"bench.toml: {location}")
    assert said in str(error)


def test_a_link_where_there_are_none(tmp_path: Path) -> None:
    text = load_bench().path.read_text().replace('"observer_fd.dbc"', '"observer_fd.dbc"\nlink = "lift"')
    with pytest.raises(UserError, match=r"there is no link 'lift'(.|\n)*add \[links.lift\] with its channel"):
        buses_of(tmp_path, text)


def test_an_option_for_each_bus() -> None:
    buses = BusesConfig.model_validate({"links": {"lift": {"channel": "can1"}}, "dbc": [{"file": "x"}]}).buses
    assert of_links("--channel", ["vcan0", "lift=vcan1", "vcan7"], buses) == {0: "vcan7", 1: "vcan1"}
    with pytest.raises(UserError, match=r"--channel lfit=vcan1: there is no link 'lfit'(.|\n)*'lift'"):
        of_links("--channel", ["lfit=vcan1"], buses)


def test_with_one_bus_a_channel_may_hold_an_equals_sign() -> None:
    assert of_links("--channel", ["socket://a?b=c"], load_bench().config.buses) == {0: "socket://a?b=c"}


def test_the_link_of_the_energizing_is_looked_up_too(tmp_path: Path) -> None:
    energizing = '[signals.energizing]\nmessage = "Pulse"\nsignal = "On"\nlink = "lfit"\n'
    with pytest.raises(UserError, match=r"signals\.energizing\.link: there is no link 'lfit'"):
        buses_of(tmp_path, THREE + energizing)
