"""A user's own bus database: other byte order, scale, unit, frame format and division, the same rates.

Frames that take turns, protected and windowed: a pause is legal only if the counter went on over all of them.
"""

import numpy as np
import pytest

from observer_rt.config.bench import Bench, load_bench
from observer_rt.engine.service.messages import Counters
from observer_rt.files.replay.framing import Span, TimedFrame
from observer_rt.files.signals.recording import Recording
from tests.benches import SAMPLE_RATE, attributes, own_bench
from tests.device import damaged, frames_of, run

WINDOWS = [Span(0, 600), Span(3000, 3600)]
TURNS = """VERSION ""
BU_: Daq
BO_ 291 Turns: 12 Daq
 SG_ Channel M : 12|4@1+ (1,0) [0|0] "" Daq
 SG_ Index : 16|32@1+ (1,0) [0|0] "" Daq
{signals}
"""


@pytest.fixture(scope="module")
def turns(tmp_path_factory: pytest.TempPathFactory) -> Bench:
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
    database = TURNS.format(signals="\n".join(signals)) + attributes([291], {291: (1, 291)})
    roles = zip(("rail_pressure", "needle_lift", "line_pressure"), channels, strict=True)
    lines = {role: f'message = "Turns"\nindex = "Index"\npattern = "{name}{{}}"' for role, (name, _) in roles}
    return load_bench(own_bench(folder, database, lines, f"[sampling]\nrate_hz = {SAMPLE_RATE}\n"))


def standstill_frames(turns: Bench) -> list[TimedFrame]:
    """Two windows of a closed needle."""
    samples = 4000
    pressure = np.full(samples, 100e6)
    recording = Recording(np.arange(samples) / SAMPLE_RATE, pressure, np.zeros(samples), pressure)
    return frames_of(turns, recording, WINDOWS)


def counted(turns: Bench, frames: list[TimedFrame]) -> Counters:
    return run(turns, frames).core.counters


def test_a_pause_is_no_loss(turns: Bench) -> None:
    counters = counted(turns, standstill_frames(turns))
    assert (counters.jumps, counters.lost_samples, counters.sequence_errors) == (1, 0, 0)
    assert counters.samples == 1200


@pytest.mark.parametrize("missing", range(6))
def test_a_frame_lost_at_a_pause_makes_it_a_loss(turns: Bench, missing: int) -> None:
    """Any of the last three frames before it and the first three after it."""
    frames = standstill_frames(turns)
    first = len(frames) // 2 - 3 + missing
    counters = counted(turns, frames[:first] + frames[first + 1 :])
    assert counters.jumps == 0
    assert counters.lost_samples >= 2400


def test_a_repeated_frame_changes_nothing(turns: Bench) -> None:
    frames = standstill_frames(turns)
    last = len(frames) // 2 - 1
    counters = counted(turns, [*frames[: last + 1], frames[last], *frames[last + 1 :]])
    assert (counters.jumps, counters.lost_samples, counters.repeated_frames) == (1, 0, 1)


def test_damaged_frames_are_counted_once(turns: Bench) -> None:
    frames = standstill_frames(turns)
    frames[9] = damaged(frames[9], 56)
    counters = counted(turns, frames)
    assert (counters.crc_errors, counters.frames, counters.lost_samples) == (1, len(frames), 3)
