"""`observer-rt effects`, a unit wherever an effect is named; the page on effects of one's own, in every command."""

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.config.own_effects import use_effects
from observer_rt.model.effects import VOCABULARY
from tests.desk.cli.conftest import Command
from tests.pages import Page, words_of


def test_every_effect_with_its_units_and_what_it_is_taken_for(command: Command) -> None:
    done = command.done("effects")
    for effect in VOCABULARY.values():
        assert effect.id in done.out
        for parameter in effect.parameters:
            assert f":{parameter.name} = " in done.out
    assert ":d = -60 to 60 us" in done.out
    assert "hard to tell from line_pressure_sensor_lag" in done.out
    assert "the same in every signal as line_volume" in done.out


def test_one_effect_in_detail(command: Command) -> None:
    done = command("effects", "channel_skew")
    assert "matters from d = 2 us on" in done.out
    assert "shows as: The whole line pressure is shifted in time" in done.out
    assert "one signal fed to both pressure channels" in done.out
    assert "seat_area" not in done.out
    assert "a switch" in command("effects", "seat_outflow").out


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


@pytest.mark.parametrize("size", ["10", "10us", "10 us"])
def test_a_simulated_effect_is_told_with_its_unit(command: Command, tmp_path: Path, size: str) -> None:
    output = tmp_path / "late.csv"
    done = command.done(
        "simulate", "--injections", 1, "--effect", f"channel_skew:d={size}", "--output", output
    )
    assert "channel_skew d = 10 us" in done.err


PAGE = Page("docs/effects.md")


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder the user is in, with the page's file in it."""
    found = re.search(r"`(\w+\.py)`:\n\n```python\n(.*?)```", PAGE.text, re.DOTALL)
    assert found is not None
    monkeypatch.chdir(tmp_path)
    path = tmp_path / found[1]
    path.write_text(found[2])
    yield path
    use_effects(())


@pytest.mark.slow
def test_the_example_is_found_and_works_in_every_command(command: Command, example: Path) -> None:
    lines = [words_of(line)[0] for line in PAGE.commands]
    done = {words[0]: command(*words) for words in lines}
    assert [outcome.code for outcome in done.values()] == [0] * 4 == [0] * len(lines)
    assert re.search(r"sac_volume +The sac holds more fuel", done["effects"].out)
    assert ":r = -0.5 to 4" in done["effects"].out
    assert done["discover"].out.startswith("named: sac_volume")
    assert "sac_volume" in (example.parent / "found" / "report.html").read_text()
    checked = command("check", "--effects", example, "--model", "found/amended.toml")
    assert "sac_volume" in checked.out


@pytest.mark.parametrize(
    "words", ["check", "simulate --output x.csv", "evaluate x.csv", "discover --out found x.csv"]
)
def test_without_the_option_the_model_asks_for_it(command: Command, example: Path, words: str) -> None:
    amended = _amended(example.parent)
    said = command.refused(*shlex.split(words), "--model", amended)
    assert "unknown effect 'sac_volume'" in said
    assert "--effects" in said
    assert "sac_volume" not in command(*shlex.split(words), "--model", amended, "--effects", example).err


def test_the_daemon_asks_for_it_too(command: Command, example: Path, bench: Path) -> None:
    _amended(bench.parent)
    bench.write_text(bench.read_text().replace("[model]\n", '[model]\nfile = "amended.toml"\n'))
    assert "unknown effect 'sac_volume'" in command("run", "--bench", bench).err
    no_file = command("run", "--bench", bench, "--state", "no/folder/state.json", "--effects", example)
    assert "sac_volume" not in no_file.err
    assert "--state" in no_file.err


def _amended(folder: Path) -> Path:
    """An injector file with the example in force."""
    table = '\n[[effects]]\nid = "sac_volume"\nparameters = { r = { value = 1.5, unit = "-" } }\n'
    path = folder / "amended.toml"
    path.write_text(NOMINAL_INJECTOR.read_text() + table)
    return path


@pytest.mark.parametrize(
    "words",
    [
        "run",
        "simulate --output x.csv",
        "evaluate x.csv",
        "check",
        "replay x.csv",
        "record --out x.blf",
        "convert x.blf x.csv",
        "discover --out found x.csv",
        "effects",
    ],
)
def test_a_file_that_will_not_do_is_refused_by_every_command(
    command: Command, example: Path, words: str
) -> None:
    example.write_text(example.read_text().replace('"sac_volume")', '"sack_volume")'))
    said = command.refused(*shlex.split(words), "--effects", example)
    assert "my_effects.py: sac_volume: apply at r = -0.5 -: fails" in said
    assert "remedy: mend the law" in said


def test_the_other_bounds_of_the_page(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "worn_only.py"
    path.write_text(PAGE.fenced("python")[1])
    try:
        listed = command.done("effects", "orifice_area", "--effects", path).out
        assert "v_H = 0 to 0.5" in listed
    finally:
        use_effects(())
