"""Injections of a bench's own model: what the daemon is led through before it is ready."""

import math

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.estimation.learned import nothing_learned
from observer_rt.estimation.predictor import NO_RATE, NO_SLOPES, Setting, Window, follow
from observer_rt.model.line.interface import rest_line
from observer_rt.model.seat import normalised_area
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.simulation.needle import lift_of_stroke, strokes
from observer_rt.simulation.schedule import Event, Schedule, Shot

INJECTIONS = 3  # from the first two is learned, by that the third is judged
BEFORE = 1500  # samples of rest before each: enough for a first guess of the offset
_RAIL_PRESSURE = 60e6  # Pa
_ENERGIZING = 1e-3  # s
_AFTER = 10e-3  # s, in which needle and line come to rest


def own_injections(fitted: BenchInjector) -> Recording:
    """Injections of the model as given, with the noise the bench states."""
    rate = fitted.config.sampling.rate_hz
    period = BEFORE / rate + _ENERGIZING + _AFTER
    shots = (Shot(_ENERGIZING),)
    events = tuple(Event(BEFORE / rate + i * period, _RAIL_PRESSURE, shots) for i in range(INJECTIONS))
    found = strokes(Schedule(events, INJECTIONS * period), fitted.parameters)
    time = np.arange(math.ceil((INJECTIONS * period + _AFTER) * rate)) / rate
    lift = np.array([sum(lift_of_stroke(instant, each) for each in found) for instant in time])
    random, noise = np.random.default_rng(0), configured_noise(fitted)

    def measured(values: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
        return values + random.normal(0.0, sigma, time.size)

    return Recording(
        time,
        measured(np.full(time.size, _RAIL_PRESSURE), noise.rail_pressure),
        measured(lift, noise.needle_lift),
        measured(_line_pressure(fitted, lift), noise.line_pressure),
    )


def _line_pressure(fitted: BenchInjector, lift: NDArray[np.float64]) -> NDArray[np.float64]:
    """What a lift [m], (n,), makes of the line pressure [Pa] by the model as given."""
    constants = bench_constants(fitted)
    c = constants.coefficients
    rail = (_RAIL_PRESSURE - c.chamber_pressure) / c.pressure_scale
    start = np.full(c.states + 1, rail)
    rest_line(start[:-1], rail, c.line)
    window = Window(
        inputs=np.column_stack([np.full(lift.size, rail), [normalised_area(each, c.seat) for each in lift]]),
        output=np.zeros(lift.size),
        resting=lift <= 0.0,
        start=start,
        opening=1,
    )
    errors = np.empty(lift.size)  # of an output of 0
    setting = Setting(constants.interval, constants.substeps, c, np.zeros(c.states))
    follow(window, setting, nothing_learned(c), window.opening, errors, NO_RATE, None, NO_SLOPES)
    return c.chamber_pressure - errors * c.pressure_scale
