"""What an observer's sample costs with all that can be learned, no learning; its open step against the same in C."""

import ctypes
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from observer_rt.bus.alignment.recorded import RECORDED
from observer_rt.core.stream.stream import RECORDED_RING, RING
from observer_rt.desk.simulation.schedule import Event, Shot
from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.learning.knowledge import no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.observer import make_observer
from observer_rt.engine.service.constants import bench_constants, configured_noise
from observer_rt.engine.stream.state import Observer
from observer_rt.foundation.continuity import Break
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MILLISECOND
from observer_rt.model.line.lump import LumpLine
from observer_rt.model.network import ARGUMENTS, HIDDEN
from observer_rt.model.sensor import LAG_UNIT
from tests.observed_plants import bench_at
from tests.plants.arrays import Array
from tools.benchmarks.score import SampleTime
from tools.benchmarks.speed import native
from tools.benchmarks.speed.traffic import SAMPLE_RATE, worn_recording

RAIL_PRESSURE, OPEN_PRESSURE, OPEN_LIFT = 100 * MEGAPASCAL, 90 * MEGAPASCAL, 250 * MICROMETRE
BLOCK = 2000  # samples timed together
REPEATS = 6
LEARNED = {
    Parameter.NOZZLE_BIAS: 0.2,
    Parameter.NOZZLE_WEIGHT: 0.05,
    Parameter.SEAT_BIAS: -0.1,
    Parameter.LINE_PRESSURE_OFFSET: 0.002,
    Parameter.LINE_FRICTION: 0.5,
    Parameter.GUIDE_LEAKAGE: 0.02,
    Parameter.BULK_MODULUS: 0.05,
    Parameter.SENSOR_LAG: 20e-6 / LAG_UNIT,
    Parameter.ENTRAINED_AIR: 0.01,
    Parameter.BACK_PRESSURE: 0.02,
}
"""In force while timed: everything the observer can have learned."""
STATES = 3
BLOCKS = 400  # each of one injection; ours and C in turn
WHOLE_BLOCKS = 99
_MASK = RECORDED_RING - 1
_START, _NONE = int(Break.START), int(Break.NONE)


def run_samples(observer: Observer, inputs: Array, first_index: int) -> None:
    """Samples (n, 3) of rail pressure [Pa], needle lift [m] and line pressure [Pa] through the step, many at once."""
    for first in range(0, len(inputs), RECORDED_RING):
        block = inputs[first : first + RECORDED_RING]
        number = int(observer.memory[0]["positions"]["recorded"])
        rows = np.zeros(len(block), RECORDED)
        rows["index"] = first_index + first + np.arange(len(block))
        rows["values"] = block
        rows["broken"] = np.where(rows["index"] == 0, _START, _NONE)
        observer.recorded[np.arange(number, number + len(block)) & _MASK] = rows
        observer.stream.take(number + len(block), 0)
        observer.stream.advance()


def loaded_observer(model: Path | None = None) -> Observer:
    """An observer at 100 kHz that carries everything it can have learned; `model`: another injector file."""
    bench = bench_at(SAMPLE_RATE, model)
    constants = bench_constants(bench.injector)
    knowledge = no_knowledge(configured_noise(bench.injector), constants.coefficients.pressure_scale)
    for parameter, value in LEARNED.items():
        knowledge.in_force[parameter] = value
    return make_observer(constants, knowledge, Learner(constants, knowledge))


def measure_sample_time(model: Path | None = None) -> SampleTime:
    """Time the step on a noisy standstill and on a needle held open; `model`: another injector file."""
    observer = loaded_observer(model)
    closed = _best(observer, first_index=0, lift=0.0, line_pressure=RAIL_PRESSURE)
    opened = _best(observer, (REPEATS + 1) * BLOCK, OPEN_LIFT, OPEN_PRESSURE)
    return SampleTime(opened, closed)


def _best(observer: Observer, first_index: int, lift: float, line_pressure: float) -> float:
    """Microseconds of one core a sample, of the fastest block; the first settles and, the first time, compiles."""
    noise = np.random.default_rng(1).normal(size=(BLOCK, 3)) * (0.1e6, 0.0, 0.15e6)
    inputs = np.array([RAIL_PRESSURE, lift, line_pressure]) + noise
    return _fastest_block(observer, inputs, REPEATS, first_index) / MICROSECOND


def _fastest_block(observer: Observer, inputs: Array, blocks: int, first_index: int = 0) -> float:
    """Seconds a sample, of samples (n, 3) given again and again; the first block does not count: it may compile."""
    times = [
        thread_seconds(lambda block=block: run_samples(observer, inputs, first_index + block * len(inputs)))  # type: ignore[misc]
        for block in range(blocks + 1)
    ]
    return min(times[1:]) / len(inputs)


def thread_seconds(work: Callable[[], object]) -> float:
    """Processor time of this thread that some work takes."""
    begin = time.thread_time()
    work()
    return time.thread_time() - begin


class Model(ctypes.Structure):
    """`struct model` of observer.c."""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("a1", "a2_nozzle", "a2_seat", "a3", "a4", "leak", "air")),
        *((name, ctypes.c_double) for name in ("chamber_pressure", "a5", "a6")),
        *((name, ctypes.c_double) for name in ("seat_transition", "nozzle_transition", "nozzle_flow")),
        ("hidden", ctypes.c_double * (HIDDEN * ARGUMENTS)),
        ("output", ctypes.c_double * (2 * HIDDEN)),
        ("bias", ctypes.c_double * 2),
        ("nozzle", ctypes.c_double * 2),
        ("gain", ctypes.c_double * STATES),
        *((name, ctypes.c_double) for name in ("lag", "interval", "offset")),
        ("substeps", ctypes.c_long),
    )


@dataclass(frozen=True)
class SampleTimes:
    """Microseconds a sample of the fastest block each; largest_difference: of the two, relative, in any rate.

    whole: with events, outliers, statistics and validity, which C has not.
    """

    ours: float
    in_c: float
    whole: float
    ratio: float
    """Median over the blocks, each beside its neighbour."""
    largest_difference: float
    substeps: int


class OpenNeedle:
    """An observer that has everything it can have learned in force, in the middle of an injection."""

    def __init__(self) -> None:
        self.observer = loaded_observer()
        event = Event(20 * MILLISECOND, 100e6, (Shot(2.5 * MILLISECOND),))
        recorded = worn_recording((event,), 30 * MILLISECOND, SAMPLE_RATE)
        self.inputs = np.column_stack([recorded.rail_pressure, recorded.needle_lift, recorded.line_pressure])
        run_samples(self.observer, self.inputs, 0)
        area = self.observer.ring["seat_area"][: int(self.observer.memory[0]["positions"]["processed"])]
        is_open = np.flatnonzero(area > 0.0)
        self.first, self.end = int(is_open[0]) + 1, int(is_open[-1])
        # No innovation is an outlier from here on, whatever it leaps: the C code has no such test.
        self.observer.memory["synchronisation"]["synchronised"] = False

    def ours(self) -> Array:
        """Injection rates [m3/s] of the open samples, by compiled Python."""
        self.observer.stream.step_pairs(self.first, self.end)
        rows = self.observer.ring[self.first : self.end]
        return np.array(rows["injection_rate"])


class CObserver:
    """The same samples in C."""

    def __init__(self, at: OpenNeedle, folder: Path) -> None:
        self._observe = ctypes.CDLL(str(native.library("observer", folder))).observe
        self._observe.restype = None
        rows = at.observer.ring[at.first - 1 : at.end]
        self._inputs = np.column_stack([rows["rail_pressure"], rows["seat_area"]])
        self._output = np.ascontiguousarray(rows["line_pressure"])
        self._start = np.array([at.observer.x_tilde[at.first - 1], at.observer.x_hat[at.first - 1]])
        self._shown = float(rows["indicated"][0])
        self._rates = np.zeros(len(rows))
        self._model = model_of(at.observer)

    def rates(self) -> Array:
        """As `OpenNeedle.ours`."""
        tilde, hat = self._start[0].copy(), self._start[1].copy()
        shown = ctypes.c_double(self._shown)
        self._observe(
            ctypes.byref(self._model),
            ctypes.c_long(self._output.size),
            *(ctypes.c_void_p(a.ctypes.data) for a in (self._inputs, self._output, tilde, hat)),
            ctypes.byref(shown),
            ctypes.c_void_p(self._rates.ctypes.data),
        )
        return self._rates[1:].copy()


def model_of(observer: Observer) -> Model:
    """What is in force in an observer."""
    memory, c = observer.memory[0], observer.constants.coefficients
    in_force = memory["in_force"]
    coefficients = in_force["line"][: len(LumpLine._fields)].tolist()
    line = dict(zip(LumpLine._fields, coefficients, strict=True))
    model = Model(a5=c.sac.a5, a6=c.sac.a6, nozzle_flow=c.nozzle.flow)
    for name in ("a1", "a2_nozzle", "a2_seat", "a3", "a4", "leak", "air", "chamber_pressure"):
        setattr(model, name, line[name])
    model.seat_transition, model.nozzle_transition = c.seat.transition, c.nozzle.transition
    model.hidden[:] = memory["prior"]["hidden"].ravel().tolist()
    for name in ("output", "bias", "nozzle"):
        getattr(model, name)[:] = in_force[name].ravel().tolist()
    model.gain[:] = observer.gains[-1][[0, 1, 2]].tolist()
    model.lag, model.offset = float(in_force["sensor"][0]), float(memory["pair"]["offset"])
    model.interval, model.substeps = observer.constants.interval, observer.constants.substeps
    return model


def measure_sample(folder: Path, blocks: int = BLOCKS) -> SampleTimes:
    """Blocks of the two in turn, and of the whole step beside them. Raises UserError without a C compiler."""
    at = OpenNeedle()
    in_c = CObserver(at, folder)
    ours, theirs = at.ours(), in_c.rates()
    difference = float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs)))
    number = at.end - at.first
    turns = [(thread_seconds(at.ours), thread_seconds(in_c.rates)) for _ in range(blocks)]
    times = np.array(turns) / number / MICROSECOND
    fastest = times.min(axis=0)
    held = np.tile(at.inputs[(at.first + at.end) // 2], (RING // 64, 1))  # as in the middle of the injection
    return SampleTimes(
        float(fastest[0]),
        float(fastest[1]),
        _fastest_block(loaded_observer(), held, WHOLE_BLOCKS) / MICROSECOND,
        float(np.median(times[:, 0] / times[:, 1])),
        difference,
        at.observer.constants.substeps,
    )
