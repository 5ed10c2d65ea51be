"""The page on effects of one's own: its example does what the page says, in every command."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.config.own_effects import use_effects
from tests.cli.conftest import Command
from tests.pages import Page, words_of

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
