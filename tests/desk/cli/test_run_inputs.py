"""`observer-rt run` with the energizing, and with optional inputs, on the bus in messages of their own."""

import re
from pathlib import Path

import pytest

from observer_rt.files.replay.framing import TimedFrame
from tests.daemon import pulses, slow_frames
from tests.daemon.pulses import durations
from tests.desk.cli.bench_engineer import run_and_stop
from tests.desk.cli.conftest import Command
from tests.device import frames_of, merged

# Those of the recording, and one that does nothing.
PULSES = [(0.12, 0.5e-3), *((0.15 + 0.05 * number, 1.1e-3) for number in range(4))]
OPENED = re.compile(r"injection (\d+) at .* command (\d+), opened after (\d+) us")


def test_commands_and_missing_injections_are_printed(
    command: Command, bench: Path, worn: Path, tmp_path: Path
) -> None:
    (tmp_path / "bed.dbc").write_text(pulses.TEXT)
    text = (
        bench.read_text().replace('"can0"', f'"{tmp_path.name}"').replace("enabled = true", "enabled = false")
    )
    bench.write_text(f'{text}\n[[dbc]]\nfile = "bed.dbc"\n[signals.energizing]\n{pulses.EnergizingBy.TIME}')
    frames = merged(frames_of(bench, worn), durations(PULSES))
    outcome, _ = run_and_stop(command, bench, frames)
    assert outcome.code == 0
    printed = " ".join(outcome.err.split())
    assert "injection missing: the needle did not open within 3 ms of command 1 at index 6000" in printed
    result = [[int(number) for number in one] for one in OPENED.findall(outcome.err)]
    assert [one[:2] for one in result] == [[1, 2], [2, 3], [3, 4], [4, 5]]
    assert all(280 <= delay <= 360 for _, _, delay in result)
    assert "energizing: 5 commands, 1 injections missing, 0 without a command, opening delay 3" in printed


EVERY = 20  # frames of samples between two of the test bed
MEASURED = re.compile(r"injection (\d+): measured ([\d.]+) mg, estimate ([\d.]+) mg \(([+-][\d.]+) %\)")


@pytest.fixture
def with_optional(bench: Path, tmp_path: Path) -> Path:
    """With both optional inputs, on a channel of the test's own."""
    (tmp_path / "bed.dbc").write_text(slow_frames.TEXT)
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
            for word in (
                slow_frames.bed("LearnEnable", 0),
                slow_frames.bed("Mass", 10 + number / EVERY / 100),
            ):
                frames.append(word._replace(time=frame.time))
        frames.append(frame)
    return frames


def test_learning_stops_and_errors_of_the_estimate_are_printed(
    command: Command, with_optional: Path, worn: Path
) -> None:
    frames = sent_to(with_optional, worn)
    outcome, results = run_and_stop(command, with_optional, frames)
    status = results.last_status()
    assert outcome.code == 0
    assert "SampleBlock 0x100, Bed 0x321 at 50000 Hz" in outcome.err
    assert (status["Learning"], status["Adoptions"]) == (0, 0)
    result = [[float(number) for number in one] for one in MEASURED.findall(outcome.err)]
    assert [number for number, *_ in result] == [1, 2, 3, 4]
    for _, measured, estimate, error in result:
        assert 10.0 < measured < 10.0 + len(frames) / EVERY / 100
        assert error == pytest.approx(100 * (estimate / measured - 1), abs=0.1)
