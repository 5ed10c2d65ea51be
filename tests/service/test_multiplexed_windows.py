"""Frames that take turns, protected and windowed: a pause is legal only if the counter went on over all of them."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import Bench, load_bench
from observer_rt.recording.replay.framing import Span, TimedFrame
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.messages import Counters
from tests.device import damaged, frames_of, run

RATE = 50e3
WINDOWS = [Span(0, 600), Span(3000, 3600)]
DATABASE = """VERSION ""
BU_: Daq
BO_ 291 Turns: 12 Daq
 SG_ Channel M : 12|4@1+ (1,0) [0|0] "" Daq
 SG_ Index : 16|32@1+ (1,0) [0|0] "" Daq
{signals}
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","a","b","c","d","e","f","g","h","i","j","k","l","FD";
BA_DEF_ BO_ "E2EProfile" INT 0 22;
BA_DEF_ BO_ "E2EDataId" INT 0 65535;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "E2EProfile" 0;
BA_DEF_DEF_ "E2EDataId" 0;
BA_ "VFrameFormat" BO_ 291 14;
BA_ "E2EProfile" BO_ 291 1;
BA_ "E2EDataId" BO_ 291 291;
"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Three samples of one of three channels in a frame, profile 1."""
    folder = tmp_path_factory.mktemp("turns")
    channels = (
        ("Rail", '(0.005,0) [0|0] "MPa"'),
        ("Lift", '(0.01,-50) [0|0] "um"'),
        ("Line", '(0.005,0) [0|0] "MPa"'),
    )
    signals = [
        f" SG_ {name}{k} m{channel} : {48 + 16 * k}|16@1+ {code} Daq"
        for channel, (name, code) in enumerate(channels)
        for k in range(3)
    ]
    (folder / "turns.dbc").write_text(DATABASE.format(signals="\n".join(signals)))
    text = '[[dbc]]\nfile = "turns.dbc"\n[[dbc]]\nfile = "observer_fd.dbc"\n'
    for role, (name, _) in zip(("rail_pressure", "needle_lift", "line_pressure"), channels, strict=True):
        text += f'[signals.{role}]\nmessage = "Turns"\nindex = "Index"\npattern = "{name}{{}}"\n'
    path = Path(folder, "bench.toml")
    path.write_text(text + f"[sampling]\nrate_hz = {RATE}\n")
    return load_bench(path)


def standstill_frames(bench: Bench) -> list[TimedFrame]:
    """Two windows of a closed needle."""
    samples = 4000
    pressure = np.full(samples, 100e6)
    recording = Recording(np.arange(samples) / RATE, pressure, np.zeros(samples), pressure)
    return frames_of(bench, recording, WINDOWS)


def counted(bench: Bench, frames: list[TimedFrame]) -> Counters:
    return run(bench, frames).core.counters


def test_a_pause_is_no_loss(bench: Bench) -> None:
    counters = counted(bench, standstill_frames(bench))
    assert (counters.jumps, counters.lost_samples, counters.sequence_errors) == (1, 0, 0)
    assert counters.samples == 1200


@pytest.mark.parametrize("missing", range(6))
def test_a_frame_lost_at_a_pause_makes_it_a_loss(bench: Bench, missing: int) -> None:
    """Any of the last three frames before it and the first three after it."""
    frames = standstill_frames(bench)
    first = len(frames) // 2 - 3 + missing
    counters = counted(bench, frames[:first] + frames[first + 1 :])
    assert counters.jumps == 0
    assert counters.lost_samples >= 2400


def test_a_repeated_frame_changes_nothing(bench: Bench) -> None:
    frames = standstill_frames(bench)
    last = len(frames) // 2 - 1
    counters = counted(bench, [*frames[: last + 1], frames[last], *frames[last + 1 :]])
    assert (counters.jumps, counters.lost_samples, counters.repeated_frames) == (1, 0, 1)


def test_damaged_frames_are_counted_once(bench: Bench) -> None:
    frames = standstill_frames(bench)
    frames[9] = damaged(frames[9], 56)
    counters = counted(bench, frames)
    assert (counters.crc_errors, counters.frames, counters.lost_samples) == (1, len(frames), 3)
