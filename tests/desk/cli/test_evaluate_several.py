"""Files and a bench of three injectors: `evaluate` and `convert` for one of them, `replay` for all."""

from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.formats import read_recording, write_recording
from observer_rt.foundation.units import MILLIGRAM
from tests.desk.cli.conftest import Command, document
from tests.device import candump_lines
from tests.three_injectors import NAMES, one_alone, three_on, three_recordings


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bench of three, `bus.log` with the frames of all, and the recording of the first."""
    folder = tmp_path_factory.mktemp("three")
    three = three_on(folder, "can0")
    (folder / "bus.log").write_text("".join(candump_lines(three.frames)))
    for name, recording in zip(NAMES, three.recordings, strict=True):
        write_recording(folder / f"{name}.csv", recording)
    return folder


def test_one_of_them_as_alone(command: Command, folder: Path) -> None:
    arguments = folder / "bus.log", "--bench", folder / "bench.toml"
    assert "choose one, such as --injector one" in command.refused("evaluate", *arguments)
    json_document = document(command, *arguments, "--injector", "two")
    alone = evaluate(load_bench(one_alone(folder, 1, "can0")), [three_recordings()[1]])
    (recording,) = json_document["recordings"]
    masses = [one.mass / MILLIGRAM for one in alone.evaluations[0].reports]
    assert [one["mass_mg"] for one in recording["injections"]] == masses


def test_the_signals_of_one_out_of_a_log(command: Command, folder: Path, tmp_path: Path) -> None:
    arguments = "convert", folder / "bus.log", tmp_path / "two.csv", "--bench", folder / "bench.toml"
    assert "choose one, such as --injector one" in command.refused(*arguments)
    command.done(*arguments, "--injector", "two")
    recording, sent = read_recording(tmp_path / "two.csv"), read_recording(folder / "two.csv")
    assert abs(recording.needle_lift - sent.needle_lift[: recording.samples]).max() < 1e-8
    command.refused("convert", folder / "bus.log", tmp_path / "bus.blf", "--injector", "two")
