"""Whether anything wrong is ever valid: recordings with a fault from a moment on, for every way of learning."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_injector
from observer_rt.desk.simulation.plant import Truth
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.news import Notes
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.state import Reason
from observer_rt.files.replay.framing import Framer, whole
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLISECOND, MM3_PER_MS
from observer_rt.model.effects import sized
from tests.observed_plants import bench_at
from tests.plants.arrays import Array
from tests.plants.plant import LIFT, LINE, RAIL, SIGNALS

SAMPLE_RATE = 50e3  # Hz
EVENTS, PERIOD = 8, 50 * MILLISECOND
FAULTY_FROM = 4  # injections before the fault
LARGEST_LINE_PRESSURE = 317 * MEGAPASCAL  # the example database can say
MASS_TOLERANCE = 0.012
RATE_TOLERANCE = 2 * MM3_PER_MS


class Learning(StrEnum):
    """How the observer learns."""

    ON = "on"
    OFF = "off"
    HELD = "held"  # what was learned before is in force
    LATE = "late"  # no outcome is ever ready


class Onset(StrEnum):
    """When a fault begins."""

    START = "from the start"
    SHUT = "between injections"
    OPEN = "while the needle is open"


Signals = dict[str, Array]


def _scaled(factor: float, *names: str) -> Callable[[Signals], Signals]:
    return lambda signals: {name: signals[name] * factor for name in names}


def _shifted(offset: float, name: str) -> Callable[[Signals], Signals]:
    return lambda signals: {name: signals[name] + offset}


def _frozen(name: str) -> Callable[[Signals], Signals]:
    return lambda signals: {name: np.full_like(signals[name], signals[name][0])}


FAULTS: dict[str, Callable[[Signals], Signals]] = {
    "line pressure in bar": _scaled(0.1, LINE),
    "rail pressure in bar": _scaled(0.1, RAIL),
    "both pressures in bar": _scaled(0.1, RAIL, LINE),
    "line pressure times ten": lambda s: {LINE: np.minimum(10.0 * s[LINE], LARGEST_LINE_PRESSURE)},
    "line pressure reads 10 % low": _scaled(0.9, LINE),
    "lift in mm": _scaled(1e-3, LIFT),
    "lift doubled": _scaled(2.0, LIFT),
    "line pressure dead": _scaled(0.0, LINE),
    "rail pressure dead": _scaled(0.0, RAIL),
    "lift dead": _scaled(0.0, LIFT),
    "line pressure frozen": _frozen(LINE),
    "rail pressure frozen": _frozen(RAIL),
    "lift frozen": _frozen(LIFT),
    "line pressure 5 MPa high": _shifted(5 * MEGAPASCAL, LINE),
    "line pressure 3 MPa low": _shifted(-3 * MEGAPASCAL, LINE),
    "rail pressure 5 MPa high": _shifted(5 * MEGAPASCAL, RAIL),
    "lift 20 um high": _shifted(20 * MICROMETRE, LIFT),
    "pressures swapped": lambda s: {RAIL: s[LINE], LINE: s[RAIL]},
    "lift and line pressure swapped": lambda s: {LIFT: 1e-12 * s[LINE], LINE: 1e12 * s[LIFT]},
}
WEAR = (0.0, 0.3)  # v_H


@dataclass(frozen=True)
class Surgery:
    """What is done to which recording, and how the observer learns meanwhile; fault None: nothing."""

    wear: float
    fault: str | None
    onset: Onset
    learning: Learning


@dataclass(frozen=True)
class Finding:
    """What a surgery showed.

    wrong_injections: valid ones whose mass is wrong; wrong_samples: valid ones whose rate is wrong, the longest run
    of them in `longest_run`; valid: injections.
    """

    surgery: Surgery
    injections: int
    valid: int
    wrong_injections: int
    wrong_samples: int
    longest_run: int
    reason: Reason


def surgeries() -> list[Surgery]:
    """Every fault with every onset, and no fault once, for every wear and way of learning."""
    nothing = [Surgery(wear, None, Onset.START, learning) for wear, learning in product(WEAR, Learning)]
    return nothing + [Surgery(*of) for of in product(WEAR, FAULTS, Onset, Learning)]


def operate(surgery: Surgery) -> Finding:
    """Observe the recording, frame by frame, with the fault in it."""
    bench = bench_at(SAMPLE_RATE)
    recording, truth = _injections(surgery.wear)
    knowledge = _learned(surgery.wear) if surgery.learning is Learning.HELD else None
    seen = _observed(bench, _faulty(recording, surgery), surgery.learning, knowledge)
    wrong = 0
    for report in seen.notes.injections:
        volume = float(np.trapezoid(truth.injection_rate[report.start : report.end + 1])) / SAMPLE_RATE
        wrong += report.valid and abs(report.volume / volume - 1) > MASS_TOLERANCE
    rows = seen.rows
    error = np.abs(rows["injection_rate"] - truth.injection_rate[rows["index"]])
    is_wrong = rows["valid"] & (error > RATE_TOLERANCE)
    return Finding(
        surgery,
        len(seen.notes.injections),
        sum(report.valid for report in seen.notes.injections),
        wrong,
        int(is_wrong.sum()),
        _longest_run(is_wrong),
        seen.core.state[1],
    )


@dataclass(frozen=True)
class _Seen:
    core: Core
    notes: Notes
    rows: NDArray[np.void]


class _Never(Executor):
    """Takes jobs and never finishes one."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        return Future()


@cache
def _injections(wear: float) -> tuple[Recording, Truth]:
    schedule = make_schedule(
        [60 * MEGAPASCAL, 100 * MEGAPASCAL, 140 * MEGAPASCAL],
        EVENTS,
        PERIOD,
        [0.5 * MILLISECOND, 1.1 * MILLISECOND],
    )
    worn = (sized("orifice_area", v_H=wear),) if wear else ()
    made = simulate(load_injector(), schedule, SAMPLE_RATE, worn, SimulatedNoise(), seed=5)
    return made.recording, made.truth


@cache
def _learned(wear: float) -> Knowledge:
    return _observed(bench_at(SAMPLE_RATE), _injections(wear)[0], Learning.ON, None).core.knowledge


def _faulty(recording: Recording, surgery: Surgery) -> Recording:
    if surgery.fault is None:
        return recording
    is_open = recording.needle_lift > 20 * MICROMETRE
    opening = int(np.flatnonzero(np.diff(is_open.astype(int)) == 1)[FAULTY_FROM])
    first = {
        Onset.START: 0,
        Onset.SHUT: opening - round(12 * MILLISECOND * SAMPLE_RATE),
        Onset.OPEN: opening + round(0.4 * MILLISECOND * SAMPLE_RATE),
    }[surgery.onset]
    signals = {name: getattr(recording, name).copy() for name in SIGNALS}
    changed = FAULTS[surgery.fault]({name: values[first:] for name, values in signals.items()})
    for name, values in changed.items():
        signals[name] = np.append(signals[name][:first], values)
    return replace(recording, **signals)


def _observed(bench: Bench, recording: Recording, learning: Learning, knowledge: Knowledge | None) -> _Seen:
    bus, notes = map_bus(bench), Notes()
    core = Core(
        bench.injector,
        bus,
        knowledge,
        learning=learning in (Learning.ON, Learning.LATE),
        executor=_Never() if learning is Learning.LATE else None,
        listeners=[notes],
    )
    rows = list(_rows(core, Framer(bus), recording))
    return _Seen(core, notes, np.concatenate(rows))


def _rows(core: Core, framer: Framer, recording: Recording) -> Iterator[NDArray[np.void]]:
    """What becomes of every sample, a frame's at a time."""
    seen = 0
    for frame in framer.frames(recording, whole(recording)):
        core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus)
        yield core.rows(seen, core.processed)
        seen = core.processed
    core.finish()
    yield core.rows(seen, core.processed)


def _longest_run(of: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], of.astype(np.int8), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))
