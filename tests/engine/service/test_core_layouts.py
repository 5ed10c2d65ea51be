"""A user's own bus database: other byte order, scale, unit, frame format and division, the same rates.

Frames that take turns, protected and windowed: a pause is legal only if the counter went on over all of them.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Database

from observer_rt.config.bench import Bench, load_bench
from observer_rt.engine.service.messages import Counters
from observer_rt.files.replay.framing import Span, TimedFrame
from observer_rt.files.signals.recording import Recording
from tests.benches import SAMPLE_RATE, attributes, own_bench
from tests.device import Traffic, damaged, encoded, frames_of, run, simulated

SAMPLES = 6  # in a block


def _block_database() -> str:
    """Big-endian 24-bit blocks: pressures in 0.001 bar from -500, lift signed in 0.002 um."""
    lines = ['VERSION ""', "BU_: Daq", "BO_ 291 Block: 64 Daq", ' SG_ First : 7|32@0+ (1,0) [0|0] "" Daq']
    byte = 4
    for k in range(SAMPLES):
        for name, code in (
            ("Rail", '+ (0.001,-500) [0|0] "bar"'),
            ("Line", '+ (0.001,-500) [0|0] "bar"'),
            ("Lift", '- (0.002,0) [0|0] "um"'),
        ):
            lines.append(f" SG_ {name}{k} : {8 * byte + 7}|24@0{code} Daq")
            byte += 3
    return "\n".join([*lines, attributes([291])])


def _single_database() -> str:
    """One sample a frame, one message a signal, extended classic frames, lift in millimetres as a float."""
    head = 'VERSION ""\nBU_: Daq\n'
    signals = {
        "Rail": '32|32@1+ (500,-10000000) [0|0] "Pa"',
        "Line": '32|32@1- (1,0) [0|0] "kPa"',
        "Lift": '32|32@1- (1,0) [0|0] "mm"',
    }
    for number, (name, code) in enumerate(signals.items()):
        head += f"BO_ {(1 << 31) + 0x18FF0000 + number} {name}Frame: 8 Daq\n"
        head += f' SG_ Index : 0|32@1+ (1,0) [0|0] "" Daq\n SG_ {name} : {code} Daq\n'
    return head + f"SIG_VALTYPE_ {(1 << 31) + 0x18FF0002} Lift : 1;\n"


def blocks(database: Database) -> Iterator[TimedFrame]:
    """Of six samples of all roles."""
    data, message = simulated(), database.get_message_by_name("Block")
    for first in range(0, data.samples - SAMPLES + 1, SAMPLES):
        values: dict[str, float] = {"First": first}
        for k in range(SAMPLES):
            values[f"Rail{k}"] = data.rail_pressure[first + k] / 1e5
            values[f"Line{k}"] = data.line_pressure[first + k] / 1e5
            values[f"Lift{k}"] = data.needle_lift[first + k] / 1e-6
        yield encoded(message, values)


def singles(database: Database) -> Iterator[TimedFrame]:
    """Of one sample of one role."""
    data, factors = simulated(), {"Rail": 1.0, "Line": 1e3, "Lift": 1e-3}
    for index in range(data.samples):
        for role, name in NAMES.items():
            message = database.get_message_by_name(f"{name}Frame")
            value = getattr(data, role)[index] / factors[name]
            yield encoded(message, {"Index": index, name: float(value)})


NAMES = {"rail_pressure": "Rail", "needle_lift": "Lift", "line_pressure": "Line"}
LISTED = 'message = "Block"\nindex = "First"\nsignals = [{}]'
IN_BLOCKS = {
    role: LISTED.format(", ".join(f'"{name}{k}"' for k in range(SAMPLES))) for role, name in NAMES.items()
} | {"needle_lift": 'message = "Block"\nindex = "First"\npattern = "Lift{}"'}
SINGLE = {
    role: f'message = "{name}Frame"\nindex = "Index"\nsignal = "{name}"' for role, name in NAMES.items()
}


@pytest.mark.parametrize(
    ("text", "roles", "sent"),
    [(_block_database(), IN_BLOCKS, blocks), (_single_database(), SINGLE, singles)],
    ids=["big-endian blocks in other units", "one sample a frame in three extended messages"],
)
def test_the_same_rates_by_a_database_of_ones_own(
    tmp_path: Path,
    clean: Traffic,
    text: str,
    roles: dict[str, str],
    sent: Callable[[Database], Iterator[TimedFrame]],
) -> None:
    bench = own_bench(tmp_path, text, roles, f"[sampling]\nrate_hz = {SAMPLE_RATE}\n")
    rates, usual = run(bench, sent(cantools.database.load_string(text, "dbc"))).rates, clean.result.rates
    common = sorted(set(rates) & set(usual))
    assert len(common) > 14_800
    difference = np.array([rates[index] - usual[index] for index in common])
    assert np.abs(difference).max() <= 1  # the last bit, where a rate lies between two codes
    assert max(rates.values()) > 15_000  # 50 mm3/ms: there was something to compare


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
