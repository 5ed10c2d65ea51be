"""The simulated injector: the model's equations under wear, in fine steps with the exact needle lift."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from observer_rt.core.model.model import Model, Terms, Weights, rest_state
from observer_rt.core.model.needle import NeedleStroke
from observer_rt.core.plant.plant import run_injector
from observer_rt.foundation.units import Floats
from observer_rt.model.effective import EffectiveModel, SensorTerms
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

    time: Floats
    injection_rate: Floats
    needle_lift: Floats
    rail_pressure: Floats
    line_pressure: Floats
    sac_pressure: Floats
    line_flow: Floats
    """Q_L into the closed end of the line [m3/s]."""
    recorded_line_pressure: Floats
    """Line pressure [Pa] as a slow sensor and late recording give it, without its offset."""


class _Conditions(NamedTuple):
    """Arguments of `run_injector`, in its order; rows of `strokes` are `NeedleStroke`."""

    time: Floats  # s
    rail: Floats  # p_0
    strokes: Floats
    steps: int  # from sample to sample
    bounce: float  # m
    model: Model
    network: Weights
    sensor: SensorTerms
    terms: Terms


class _Records(NamedTuple):
    states: Floats  # (n, 3), normalised
    lift: Floats  # m
    rate: Floats  # m3/s
    line_pressure: Floats  # p_0, as recorded


def run_plant(
    model: EffectiveModel,
    strokes: Sequence[NeedleStroke],
    time: Floats,
    rail_pressure: Floats,
    progress: Progress | None = None,
    bounce: float = 0.0,
) -> Truth:
    """Integrate from rest over an even `time` [s] (n,), n >= 2; bounce [m]: lift after landing.

    `rail_pressure` [Pa] (n,) is linear between samples; steps are of at most 1 us (2 us on a line of cells).
    """
    longest_step, model = _longest_step(model)
    c = model.coefficients
    period = float(time[-1] - time[0]) / (time.size - 1)
    conditions = _Conditions(
        np.ascontiguousarray(time),
        (rail_pressure - c.chamber_pressure) / c.pressure_scale,
        np.array(strokes, dtype=np.float64).reshape(len(strokes), len(NeedleStroke._fields)),
        math.ceil(period / longest_step),
        bounce,
        Model(c),
        Weights(constant_network()),
        model.sensor,
        Terms(model.program),
    )
    records = _Records(np.empty((time.size, 3)), *np.empty((3, time.size)))
    x, first_rail = np.zeros(c.states), float(conditions.rail[0])
    rest_state(x, first_rail, c)
    # the stroke under way or next, what the sensor shows, and the first sample it has not recorded yet
    stroke, shown, due = 0, first_rail, 0
    for first in range(0, time.size, SAMPLES_PER_CHUNK):
        last = min(first + SAMPLES_PER_CHUNK, time.size)
        stroke, shown, due = run_injector(x, stroke, shown, due, first, last, *conditions, *records)
        if progress is not None:
            progress(last / time.size)
    return Truth(
        time=conditions.time,
        injection_rate=records.rate,
        needle_lift=records.lift,
        rail_pressure=rail_pressure,
        line_pressure=records.states[:, 0] * c.pressure_scale + c.chamber_pressure,
        sac_pressure=records.states[:, 2] * c.pressure_scale + c.chamber_pressure,
        line_flow=records.states[:, 1] * c.flow_scale,
        recorded_line_pressure=records.line_pressure * c.pressure_scale + c.chamber_pressure,
    )


def _longest_step(model: EffectiveModel) -> tuple[float, EffectiveModel]:
    """The longest step [s], and the model for it: a line of cells gets more of them."""
    injector = model.injector
    if not isinstance(model.coefficients.line, WaveLine):
        return min(LONGEST_STEP, STEP_TIMES_RATE / fastest_rate(injector, model.coefficients)), model
    line = injector.line.model_copy(update={"cells": cells_for(injector, LONGEST_WAVE_STEP)})
    return LONGEST_WAVE_STEP, replace(model, injector=injector.model_copy(update={"line": line}))
