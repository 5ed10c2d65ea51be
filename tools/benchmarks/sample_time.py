"""What one sample costs the compiled observer: x~ with its gain, x^ with phi, rate and statistics; no learning."""

import time
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.scalars import Parameter
from observer_rt.foundation.continuity import RECORDED_RING, Break
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND
from observer_rt.model.sensor import LAG_UNIT
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.observer.learning.learner import Learner
from observer_rt.observer.observer import make_observer
from observer_rt.observer.stream.state import Observer
from observer_rt.observer.stream.step import advance_stream, take_recorded
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from tools.benchmarks.score import SampleTime
from tools.benchmarks.scoring import bench_at

SAMPLE_RATE = 100e3  # Hz
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
_MASK = RECORDED_RING - 1
_START, _NONE = int(Break.START), int(Break.NONE)


@njit(cache=True, nogil=True)
def run_samples(observer: Observer, inputs: NDArray[np.float64], first_index: int) -> None:
    """Samples (n, 3) of rail pressure [Pa], needle lift [m] and line pressure [Pa], one by one through the step."""
    for k in range(inputs.shape[0]):
        number = observer.memory[0].recorded
        row = observer.recorded[number & _MASK]
        row.index = first_index + k
        for channel in range(3):
            row.values[channel] = inputs[k, channel]
        row.broken = _START if first_index + k == 0 else _NONE
        take_recorded(observer, number + 1, 0)
        advance_stream(observer)


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
    durations = []
    for block in range(REPEATS + 1):
        begin = time.thread_time()
        run_samples(observer, inputs, first_index + block * BLOCK)
        durations.append(time.thread_time() - begin)
    return min(durations[1:]) / BLOCK / MICROSECOND
