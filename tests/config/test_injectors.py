"""Several injectors in a bench file: what they share, what is refused, and where it says so."""

from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench
from observer_rt.foundation.errors import UserError
from tests.two_injectors import BOTH, one_injector, two_injectors


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


def test_only_one_can_be_run(tmp_path: Path) -> None:
    bench = load_bench(two_injectors(tmp_path))
    with pytest.raises(
        UserError, match="this version runs one injector, the file has 2: left, right"
    ) as refused:
        _ = bench.injector
    assert refused.value.exit_code == 2


WRONG = {
    "injectors.left.output": ("[injectors.left.outputs]", "did you mean 'outputs'?"),
    "injectors.right.outputs.injecter_id = 3": ("injector_id = 2", "did you mean 'injector_id'?"),
    "injectors.left.signals.needle_lift.link = 'lft'": ('link = "left"', "did you mean 'left'?"),
    "learning.event_gap = 8": ("event_gap_ms = 8", "did you mean 'event_gap_ms'?"),
    "learning.event_gap_ms = 0": ("event_gap_ms = 8", "correct the value"),
    "injectors.left.link": ("[injectors.left.signals.line_pressure]", "unknown key"),
    "injectors.a b": ("[injectors.right.signals.needle_lift]", "is not allowed"),
    "samplin": ("[sampling]", "did you mean 'sampling'?"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_mistakes_are_named_where_they_are(tmp_path: Path, wrong: str) -> None:
    """wrong: the place, with the value there or, without one, as a section."""
    old, said = WRONG[wrong]
    place, _, value = wrong.partition(" = ")
    key = place.rpartition(".")[2]
    new = f"{key} = {value}" if value else "[" + place.replace("a b", "'a b'") + "]"
    assert old in BOTH
    path = tmp_path / "bench.toml"
    path.write_text(BOTH.replace(old, new))
    with pytest.raises(UserError) as raised:
        load_bench(path)
    assert raised.value.place == f"{path}: {place}"
    assert said in str(raised.value)


def test_a_role_that_an_injector_has_not_is_missed(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(BOTH[: BOTH.index("[injectors.right.signals.line_pressure]")])
    with pytest.raises(UserError) as raised:
        load_bench(path)
    assert raised.value.place.endswith("signals.line_pressure")
    assert raised.value.problem == "is missing"
