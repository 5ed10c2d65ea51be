"""The simulated injector: the model's equations under wear, in fine steps with the exact needle lift."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inner
from observer_rt.model.effective import Coefficients, EffectiveModel, SensorTerms
from observer_rt.model.forcing import Clock, Forcing, forcing_of, rate_after, shown_under_terms, under_terms
from observer_rt.model.hydraulics import normalised_area
from observer_rt.model.integrator import Interval, fine_step
from observer_rt.model.line.interface import rest_line
from observer_rt.model.line.wave import WaveLine, cells_for
from observer_rt.model.network import Network, constant_network
from observer_rt.model.sensor import lagged
from observer_rt.model.stability import fastest_rate
from observer_rt.simulation.schedule import CORNER_ROUNDING, Stroke, lift_of_stroke

LONGEST_STEP = 1e-6  # s
LONGEST_WAVE_STEP = 2e-6  # s, of a line of cells
STEP_TIMES_RATE = 1.0  # step times fastest rate: accurate, RK4 would be stable to 2.78
EMPTY_SAC = 1e-9  # of the pressure scale, below which a shut sac is at chamber pressure
SAMPLES_PER_CHUNK = 10_000  # between two reports of progress

Progress = Callable[[float], None]
"""Called with the share done, 0 to 1."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Noise-free signals of the simulated injector at the sample times, SI, every array of shape (n,)."""

    time: NDArray[np.float64]
    """[s]"""
    injection_rate: NDArray[np.float64]
    """[m3/s]"""
    needle_lift: NDArray[np.float64]
    """[m]"""
    rail_pressure: NDArray[np.float64]
    """[Pa]"""
    line_pressure: NDArray[np.float64]
    """[Pa]"""
    sac_pressure: NDArray[np.float64]
    """[Pa]"""
    line_flow: NDArray[np.float64]
    """Q_L into the closed end of the line [m3/s]."""
    recorded_line_pressure: NDArray[np.float64]
    """Line pressure [Pa] as a slow sensor and late recording give it, without its offset."""


def run_plant(
    model: EffectiveModel,
    strokes: Sequence[Stroke],
    time: NDArray[np.float64],
    rail_pressure: NDArray[np.float64],
    progress: Progress | None = None,
) -> Truth:
    """Integrate the injector from rest over an even `time` [s], shape (n,), n >= 2.

    `rail_pressure` [Pa], shape (n,), is linear between samples; the lift is exact at every stage of every
    step. The steps are at most 1 us, an integer number per sample.
    """
    longest_step, model = _longest_step(model)
    c = model.coefficients
    network = constant_network()
    forcing = forcing_of(model.program, Clock(), len(c.line))
    period = float(time[-1] - time[0]) / (time.size - 1)
    steps = math.ceil(period / longest_step)
    rail = (rail_pressure - c.chamber_pressure) / c.pressure_scale
    table = np.array(strokes, dtype=np.float64).reshape(len(strokes), len(Stroke._fields))
    states = np.empty((time.size, 3))
    x = np.zeros(c.states)
    rest_line(x, float(rail[0]), c.line)
    lift = np.empty(time.size)
    rate = np.empty(time.size)
    recorded = np.empty(time.size)
    number, indicated, due = 0, float(rail[0]), 0
    for first in range(0, time.size, SAMPLES_PER_CHUNK):
        last = min(first + SAMPLES_PER_CHUNK, time.size)
        number, indicated, due = _run(
            x,
            number,
            indicated,
            due,
            first,
            last,
            time,
            rail,
            table,
            steps,
            c,
            network,
            model.sensor,
            forcing,
            states,
            lift,
            rate,
            recorded,
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
        return min(LONGEST_STEP, STEP_TIMES_RATE / fastest_rate(injector, model.departures)), model
    line = injector.line.model_copy(update={"cells": cells_for(injector, LONGEST_WAVE_STEP)})
    return LONGEST_WAVE_STEP, replace(model, injector=injector.model_copy(update={"line": line}))


@inner
def _inputs(rail: float, lift: float, c: Coefficients) -> tuple[float, float]:
    return rail, normalised_area(lift, c.seat)


@inner
def _stroke(strokes: NDArray[np.float64], number: int) -> Stroke:
    """Row `number` of the table; past its end the needle stays shut: a stroke that never begins."""
    if number >= strokes.shape[0]:
        return Stroke(math.inf, math.inf, math.inf, math.inf, 0.0, 0.0)
    row = strokes[number]
    return Stroke(row[0], row[1], row[2], row[3], row[4], row[5])


@compiled
def _run(
    x: NDArray[np.float64],
    number: int,
    indicated: float,
    due: int,
    first: int,
    last: int,
    time: NDArray[np.float64],
    rail: NDArray[np.float64],
    strokes: NDArray[np.float64],
    steps: int,
    c: Coefficients,
    network: Network,
    sensor: SensorTerms,
    forcing: Forcing,
    states: NDArray[np.float64],
    lift: NDArray[np.float64],
    rate: NDArray[np.float64],
    recorded: NDArray[np.float64],
) -> tuple[int, float, int]:
    """Record samples first..last-1 and step the state x (n,) on to `last`; `number` is the stroke under way or next.

    `indicated` is what the sensor shows, `due` the first sample of the line pressure not recorded yet.
    """
    s = _stroke(strokes, number)
    for n in range(first, last):
        lift[n] = lift_of_stroke(time[n], s)
        u = _inputs(rail[n], lift[n], c)
        if u[1] == 0.0 and math.fabs(x[2]) < EMPTY_SAC:
            x[2] = 0.0  # at rest, not decaying towards denormal numbers
        for i in range(3):
            states[n, i] = x[i]
        now = under_terms(x, Interval(u, u, 0.0, 1), (0.0, u[1]), c, network, forcing)
        rate[n] = rate_after(x, now)
        if n + 1 == time.size:
            recorded[due:] = shown_under_terms(indicated, now, forcing)
            break
        step = (time[n + 1] - time[n]) / steps
        for i in range(steps):
            start = time[n] + i * step
            if start > s.closed + CORNER_ROUNDING / 2.0:
                number += 1
                s = _stroke(strokes, number)
            rail_middle = rail[n] + (i + 0.5) / steps * (rail[n + 1] - rail[n])
            rail_end = rail[n] + (i + 1.0) / steps * (rail[n + 1] - rail[n])
            u_middle = _inputs(rail_middle, lift_of_stroke(start + 0.5 * step, s), c)
            u_end = _inputs(rail_end, lift_of_stroke(start + step, s), c)
            before, shown = x[0], indicated
            forced = under_terms(x, Interval(u, u_end, step, 1), (0.0, u_middle[1]), c, network, forcing)
            start_u, end_u = forced.interval.start, forced.interval.end
            middle = (u_middle[0] + end_u[0] - u_end[0], forced.knot[1])
            fine_step(x, start_u, middle, end_u, step, forced.coefficients, forced.network)
            indicated = lagged(shown, before, x[0], step, sensor.lag)
            added = shown_under_terms(indicated, forced, forcing) - indicated
            end = time[n] + (i + 1) * step if i + 1 < steps else time[n + 1]
            while due < time.size and time[due] - sensor.delay < end:
                share = max(time[due] - sensor.delay - start, 0.0) / step
                recorded[due] = shown + share * (indicated - shown) + added
                due += 1
            u = u_end
    return number, indicated, due
