"""`observer-rt effects`, a unit wherever an effect is named; no effect is read from a file of Python."""

import json
import shlex
from pathlib import Path

import pytest

from observer_rt.model.effects import VOCABULARY
from tests.desk.cli.conftest import Command
from tests.desk.cli.injector_files import amended


def test_every_effect_with_its_units_and_what_it_is_taken_for(command: Command) -> None:
    done = command.done("effects")
    for effect in VOCABULARY.values():
        assert effect.id in done.out
        for parameter in effect.parameters:
            assert f":{parameter.name} = " in done.out
    assert ":d = -60 to 60 us" in done.out
    assert "hard to tell from line_pressure_sensor_lag" in done.out
    assert "the same in every signal as line_volume" in done.out


def test_for_programs(command: Command) -> None:
    document = json.loads(command("effects", "--json").out)
    effects = {effect["id"]: effect for effect in document["effects"]}
    assert set(effects) == set(VOCABULARY)
    (skew,) = effects["channel_skew"]["parameters"]
    assert (skew["unit"], skew["lowest"], skew["highest"]) == ("us", -60.0, 60.0)
    assert effects["bulk_modulus"]["taken_for"][0]["id"] == "line_volume"
    for effect in effects.values():  # whichever of two says so, both have it
        for other in effect["taken_for"]:
            assert effect["id"] in [one["id"] for one in effects[other["id"]]["taken_for"]]


@pytest.mark.parametrize("words", ["check", "evaluate x.csv"])
def test_an_effect_that_is_not_known_is_a_law_to_state(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    """One that once came from a file of Python, which lies beside it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_effects.py").write_text("open('executed', 'w')\n")
    unknown = amended(tmp_path / "amended.toml", "my_effects", "r", 1.5)
    said = command.refused(*shlex.split(words), "--model", unknown)
    assert "amended.toml: effects.0.id: unknown effect 'my_effects'" in said
    assert "no file of Python is read" in said
    assert "[[terms]]" in said
    assert not Path("executed").exists()
