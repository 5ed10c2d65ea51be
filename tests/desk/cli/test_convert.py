"""`observer-rt convert`: frames and signals from format to format, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.formats import open_log, read_recording
from tests.desk.cli.conftest import Command
from tests.device import frames_of
from tests.files.canlog.log_cases import as_read, mixture, moved, sent_log, write_log

MOST_MOVED = 2000  # ns, by the float seconds of python-can's writers


@pytest.mark.parametrize("target", [".blf", ".log"])
def test_channels_stay_apart_and_one_can_be_chosen(command: Command, tmp_path: Path, target: str) -> None:
    frames = mixture(".trc", 50)
    write_log(tmp_path / "in.log", frames)
    command.done("convert", tmp_path / "in.log", tmp_path / f"all{target}")
    assert moved(open_log(tmp_path / f"all{target}"), as_read(frames, target)) < MOST_MOVED
    chosen = ("--from-channel", "can1")
    command.done("convert", tmp_path / "in.log", tmp_path / f"one{target}", *chosen)
    assert len(list(open_log(tmp_path / f"one{target}"))) == sum(f.channel == "2" for f in frames)


def test_an_error_names_the_file_and_not_its_part(command: Command, tmp_path: Path) -> None:
    log = tmp_path / "in.log"
    late = "".join(f"({1700000010 + n}.5) can0 100#00\n" for n in range(1000))
    log.write_text(f"{late}(1700000001.5) can1 100#00\n")
    said = command.refused("convert", log, tmp_path / "out.blf")
    assert f"{tmp_path}/out.blf: a frame is older than the first ones" in said
    assert list(tmp_path.iterdir()) == [log]


def test_what_is_lost_is_said(command: Command, tmp_path: Path) -> None:
    log = tmp_path / "in.log"
    log.write_text("(1.000000001) can0 100#00\n(1.1) can0 100#R\n(1.2) can0 100#00\n")
    outcome = command.done("convert", log, tmp_path / "out.blf")
    assert "left out: 1 remote frames" in outcome.err
    assert "1 stamps are rounded to multiples of 1000 ns" in outcome.err


def test_a_log_becomes_a_recording_by_a_bench_file(command: Command, tmp_path: Path, worn: Path, bench: Path) -> None:
    """Replayed, recorded, converted: the samples that were sent, in the recording's own time."""
    recording = read_recording(worn)
    frames = sent_log(frames_of(bench, recording))
    write_log(tmp_path / "bus.blf", frames)
    for target in ("out.csv", "out.mf4"):
        outcome = command.done("convert", tmp_path / "bus.blf", tmp_path / target, "--bench", bench)
        assert "at 50000 Hz, from sample index 0 on" in outcome.out
        result = read_recording(tmp_path / target)
        error = np.abs(result.rail_pressure[: recording.samples] - recording.rail_pressure)
        assert error.max() <= 0.0026e6
        assert "are missing" not in outcome.err
    write_log(tmp_path / "bus.blf", frames[:100] + frames[102:])
    outcome = command.done("convert", tmp_path / "bus.blf", tmp_path / "lost.csv", "--bench", bench)
    assert f"{2 * 9} samples are missing, and have empty cells" in outcome.err
