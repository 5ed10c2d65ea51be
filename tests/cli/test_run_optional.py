"""`observer-rt run` with optional inputs on the bus, in messages of their own."""

import re
from pathlib import Path

import pytest

from observer_rt.recording.replay.framing import TimedFrame
from tests.cli.bench_engineer import run_and_stop
from tests.cli.conftest import Command
from tests.device import frames_of
from tests.service.slow_frames import TEXT, bed

EVERY = 20  # frames of samples between two of the test bed
LINE = re.compile(r"injection (\d+): measured ([\d.]+) mg, estimate ([\d.]+) mg \(([+-][\d.]+) %\)")


@pytest.fixture
def bench(bench: Path, tmp_path: Path) -> Path:
    """With both optional inputs, on a channel of the test's own."""
    (tmp_path / "bed.dbc").write_text(TEXT)
    text = bench.read_text().replace('"can0"', f'"{tmp_path.name}"')
    bench.write_text(
        f'{text}\n[[dbc]]\nfile = "bed.dbc"\n'
        '[signals.learning_enable]\nmessage = "Bed"\nsignal = "LearnEnable"\n'
        '[signals.measured_mass]\nmessage = "Bed"\nsignal = "Mass"\n'
    )
    return bench


def sent_to(bench: Path, recording: Path) -> list[TimedFrame]:
    """Learning is off from the start; the measured mass [mg] is 10, 10.01, 10.02, ..."""
    frames: list[TimedFrame] = []
    for number, frame in enumerate(frames_of(bench, recording)):
        if number % EVERY == 0:
            for word in (bed("LearnEnable", 0), bed("Mass", 10 + number / EVERY / 100)):
                frames.append(word._replace(time=frame.time))
        frames.append(frame)
    return frames


def test_learning_stops_and_errors_of_the_estimate_are_printed(
    command: Command, bench: Path, worn: Path
) -> None:
    frames = sent_to(bench, worn)
    outcome, heard = run_and_stop(command, bench, frames)
    status = heard.last_status()
    assert outcome.code == 0
    assert "SampleBlock, Bed at 50000 Hz" in outcome.err
    assert (status["Learning"], status["Adoptions"]) == (0, 0)
    found = [[float(number) for number in one] for one in LINE.findall(outcome.err)]
    assert [number for number, *_ in found] == [1, 2, 3, 4]
    for _, measured, estimate, error in found:
        assert 10.0 < measured < 10.0 + len(frames) / EVERY / 100
        assert error == pytest.approx(100 * (estimate / measured - 1), abs=0.1)
