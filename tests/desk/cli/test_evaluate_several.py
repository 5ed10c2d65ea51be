"""Files and a bench of three injectors: `evaluate`, `convert`, `check` and `replay` for all of them, or for one."""

import json
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.formats import read_recording, write_recording
from observer_rt.foundation.units import MILLIGRAM
from tests.desk.cli.conftest import Command, document
from tests.device import candump_lines
from tests.three_injectors import NAMES, lift_id, one_alone, three_injectors, three_on, three_recordings


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bench of three, `bus.log` with the frames of all, and the recording of the first."""
    folder = tmp_path_factory.mktemp("three")
    three = three_on(folder, "can0")
    (folder / "bus.log").write_text("".join(candump_lines(three.frames)))
    for name, each in zip(NAMES, three.recordings, strict=True):
        write_recording(folder / f"{name}.csv", each)
    return folder


def test_all_of_them_each_as_alone(command: Command, folder: Path) -> None:
    found = document(command, folder / "bus.log", "--bench", folder / "bench.toml")["injectors"]
    assert list(found) == list(NAMES)
    for number, name in enumerate(NAMES):
        alone = evaluate(load_bench(one_alone(folder, number, "can0")), [three_recordings()[number]])
        masses = [one.mass / MILLIGRAM for one in alone.evaluations[0].reports]
        (recording,) = found[name]["recordings"]
        assert [one["mass_mg"] for one in recording["injections"]] == masses
    chosen = document(command, folder / "bus.log", "--bench", folder / "bench.toml", "--injector", "two")
    assert chosen == found["two"]


def test_tables_and_files_are_told_apart(
    command: Command, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files = "--plot", "worn.png", "--output", "traces", "--save-state", "learned.json"
    arguments = "evaluate", folder / "bus.log", "--bench", folder / "bench.toml"
    outcome = command.done(*arguments, *files)
    headings = [line for line in outcome.out.splitlines() if line.startswith("injector ")]
    assert headings == [f"injector {name}" for name in NAMES]
    made = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert made == {
        file
        for name in NAMES
        for file in (f"worn_{name}.png", f"learned_{name}.json", f"traces/{name}/bus.log.trace.csv")
    }
    (tmp_path / "worn_two.png").unlink()
    assert "worn_one.png" in command.refused(*arguments, "--plot", "worn.png")
    assert not (tmp_path / "worn_two.png").exists()
    known = command(*arguments, "--state", "learned.json")
    assert known.err.count("learned state restored") == 3


def test_a_recording_is_one_injectors(command: Command, folder: Path) -> None:
    arguments = "evaluate", folder / "two.csv", "--bench", folder / "bench.toml"
    said = command.refused(*arguments)
    assert "has the signals of one injector" in said
    assert "--injector one" in said
    command.done(*arguments, "--injector", "two")


def test_the_signals_of_one_out_of_a_log(command: Command, folder: Path, tmp_path: Path) -> None:
    arguments = "convert", folder / "bus.log", tmp_path / "two.csv", "--bench", folder / "bench.toml"
    assert "choose one, such as --injector one" in command.refused(*arguments)
    command.done(*arguments, "--injector", "two")
    found, sent = read_recording(tmp_path / "two.csv"), read_recording(folder / "two.csv")
    assert abs(found.needle_lift - sent.needle_lift[: found.samples]).max() < 1e-8
    command.refused("convert", folder / "bus.log", tmp_path / "bus.blf", "--injector", "two")


def test_a_log_of_all_is_replayed_whole(command: Command, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "injectors.dbc").write_text((folder / "injectors.dbc").read_text())
    path = three_injectors(tmp_path, tmp_path.name)
    lines = (folder / "bus.log").read_text().splitlines(keepends=True)
    (tmp_path / "part.log").write_text("".join([*lines[:700], f"(9.0) can0 302##1{'00' * 64}\n"]))
    outcome = command.done("replay", tmp_path / "part.log", "--bench", path, "--speed", "0", "--json")
    assert json.loads(outcome.out)["frames"] == 700  # not the recorded result


def without_lift(folder: Path, number: int, path: Path) -> Path:
    """The log of all without the needle lift of one of them."""
    lines = (folder / "bus.log").read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if f" {lift_id(number):03X}##" not in line))
    return path


def test_one_whose_inputs_are_missing_leaves_the_others_alone(
    command: Command, folder: Path, tmp_path: Path
) -> None:
    log = without_lift(folder, 1, tmp_path / "part.log")
    arguments = "evaluate", log, "--bench", folder / "bench.toml"
    outcome = command(*arguments)
    assert outcome.code == 2
    assert "error: two: " in outcome.err
    assert f"NeedleLiftBlock_two 0x{lift_id(1):03X}" in outcome.err
    assert outcome.out.count("not evaluated: its ") == 1
    assert outcome.out.split("injector two\n")[1].startswith("not evaluated: its ")
    printed = command(*arguments, "--json")
    assert printed.code == 2
    found = json.loads(printed.out)["injectors"]
    assert list(found) == list(NAMES)
    assert "NeedleLiftBlock_two" in found["two"]["error"]
    alone = document(command, folder / "bus.log", "--bench", folder / "bench.toml", "--injector", "three")
    assert found["three"]["recordings"][0]["injections"] == alone["recordings"][0]["injections"] != []
