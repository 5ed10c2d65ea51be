"""What a sample costs as numbers grow: samples, integration steps, samples in a frame.

The hidden neurons do not grow: the network has five, fixed in the model.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.foundation.units import MICROSECOND, MILLISECOND
from observer_rt.recording.replay.framing import Framer, whole
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.core.core import Core
from observer_rt.simulation.schedule import Event, Shot
from tools.benchmarks.scoring import bench_at, with_signals
from tools.benchmarks.speed.traffic import SAMPLE_RATE, worn_recording

SECONDS = (0.25, 0.5, 1.0, 2.0)
RATES = (200e3, 100e3, 50e3, 20e3)  # Hz
BLOCKS = (1, 3, 9)  # samples in a frame of all three signals
PERIOD = 40 * MILLISECOND
PATTERNS = {
    "rail_pressure": "RailPressure_{:02d}",
    "needle_lift": "NeedleLift_{:02d}",
    "line_pressure": "LinePressure_{:02d}",
}
REPEATS = 3


@dataclass(frozen=True)
class Row:
    """One point: microseconds a sample of one core, frames through the core and nothing learned."""

    what: str
    value: float
    us_a_sample: float


def measure_scaling() -> list[Row]:
    """All points, one after the other."""
    found = [
        Row("samples", seconds * SAMPLE_RATE, _cost(bench_at(SAMPLE_RATE), _recording(SAMPLE_RATE, seconds)))
        for seconds in SECONDS
    ]
    for rate in RATES:
        bench = bench_at(rate)
        steps = bench_constants(bench.injector).substeps
        found.append(Row("substeps", steps, _cost(bench, _recording(rate, 0.25))))
    recording = _recording(SAMPLE_RATE, 0.25)
    found += [Row("block samples", block, _cost(_in_blocks(block), recording)) for block in BLOCKS]
    return found


def exponent(rows: Sequence[Row]) -> float:
    """Of the number of samples, by which the whole time grows; 1 is linear."""
    of_samples = [row for row in rows if row.what == "samples"]
    values = np.array([row.value for row in of_samples])
    times = np.array([row.us_a_sample for row in of_samples]) * values
    return float(np.polyfit(np.log(values), np.log(times), 1)[0])


def _recording(rate: float, seconds: float) -> Recording:
    """25 injections a second of a worn injector."""
    events = tuple(
        Event(10 * MILLISECOND + n * PERIOD, 100e6, (Shot(1.2 * MILLISECOND),))
        for n in range(round(seconds / PERIOD))
    )
    return worn_recording(events, seconds, rate)


def _in_blocks(block: int) -> Bench:
    """The example bench, of whose frames only the first samples count."""
    shorter = {
        role: {"pattern": None, "signals": [pattern.format(n) for n in range(block)]}
        for role, pattern in PATTERNS.items()
    }
    return with_signals(bench_at(SAMPLE_RATE), shorter)


def _cost(bench: Bench, recording: Recording) -> float:
    """Microseconds a sample of the fastest pass."""
    bus = map_bus(bench)
    frames = list(Framer(bus).frames(recording, whole(recording)))
    times = []
    for _ in range(REPEATS):
        core = Core(bench.injector, bus, learning=False)
        begin = time.thread_time()
        for frame in frames:
            core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus)
        times.append(time.thread_time() - begin)
        assert core.processed > 0.9 * recording.samples
    return min(times) / recording.samples / MICROSECOND
