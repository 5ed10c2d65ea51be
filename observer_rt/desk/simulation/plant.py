"""The simulated injector: the model's equations under wear, in fine steps with the exact needle lift."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import Model, Terms, Weights, rest_state
from observer_rt.core.model.needle import NeedleStroke
from observer_rt.core.plant.plant import run_injector
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.network import constant_network
from observer_rt.model.stability import fastest_rate
from observer_rt.model.wave_line import WaveLine, cells_for

LONGEST_STEP = 1e-6  # s
LONGEST_WAVE_STEP = 2e-6  # s, of a line of cells
STEP_TIMES_RATE = 1.0  # step times fastest rate: accurate, RK4 would be stable to 2.78
SAMPLES_PER_CHUNK = 10_000  # between two reports of progress

Progress = Callable[[float], None]
"""Called with the share done, 0 to 1."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Noise-free signals of the simulated injector at the sample times, SI, every array of shape (n,)."""

    time: NDArray[np.float64]
    injection_rate: NDArray[np.float64]
    needle_lift: NDArray[np.float64]
    rail_pressure: NDArray[np.float64]
    line_pressure: NDArray[np.float64]
    sac_pressure: NDArray[np.float64]
    line_flow: NDArray[np.float64]
    """Q_L into the closed end of the line [m3/s]."""
    recorded_line_pressure: NDArray[np.float64]
    """Line pressure [Pa] as a slow sensor and late recording give it, without its offset."""


def run_plant(
    model: EffectiveModel,
    strokes: Sequence[NeedleStroke],
    time: NDArray[np.float64],
    rail_pressure: NDArray[np.float64],
    progress: Progress | None = None,
    bounce: float = 0.0,
) -> Truth:
    """Integrate the injector from rest over an even `time` [s], shape (n,), n >= 2.

    `rail_pressure` [Pa], shape (n,), is linear between samples; the lift is exact at every stage of every
    step. The steps are at most 1 us (2 us on a line of cells), an integer number per sample. bounce [m]: lift after
    landing.
    """
    longest_step, model = _longest_step(model)
    c = model.coefficients
    parts = Model(c), Weights(constant_network()), model.sensor, Terms(model.program)
    period = float(time[-1] - time[0]) / (time.size - 1)
    steps = math.ceil(period / longest_step)
    time, rail = np.ascontiguousarray(time), (rail_pressure - c.chamber_pressure) / c.pressure_scale
    table = np.array(strokes, dtype=np.float64).reshape(len(strokes), len(NeedleStroke._fields))
    states, lift, rate, recorded = np.empty((time.size, 3)), *np.empty((3, time.size))
    x = np.zeros(c.states)
    rest_state(x, float(rail[0]), c)
    number, indicated, due = 0, float(rail[0]), 0
    for first in range(0, time.size, SAMPLES_PER_CHUNK):
        last = min(first + SAMPLES_PER_CHUNK, time.size)
        state, grid = (x, number, indicated, due), (time, rail, table, steps)
        number, indicated, due = run_injector(
            *state, first, last, *grid, bounce, *parts, states, lift, rate, recorded
        )
        if progress is not None:
            progress(last / time.size)
    return Truth(
        time=time,
        injection_rate=rate,
        needle_lift=lift,
        rail_pressure=rail_pressure,
        line_pressure=states[:, 0] * c.pressure_scale + c.chamber_pressure,
        sac_pressure=states[:, 2] * c.pressure_scale + c.chamber_pressure,
        line_flow=states[:, 1] * c.flow_scale,
        recorded_line_pressure=recorded * c.pressure_scale + c.chamber_pressure,
    )


def _longest_step(model: EffectiveModel) -> tuple[float, EffectiveModel]:
    """The longest step [s], and the model for it: a line of cells gets more of them."""
    injector = model.injector
    if not isinstance(model.coefficients.line, WaveLine):
        return min(LONGEST_STEP, STEP_TIMES_RATE / fastest_rate(injector, model.coefficients)), model
    line = injector.line.model_copy(update={"cells": cells_for(injector, LONGEST_WAVE_STEP)})
    return LONGEST_WAVE_STEP, replace(model, injector=injector.model_copy(update={"line": line}))
