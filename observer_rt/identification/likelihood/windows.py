"""The judged stretches of a recording as windows of the predictor, and the predictor run through them.

A shot is an opening of a needle without measured lift; its delays are drawn anew in every event (jitter).
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.phases import phases_of
from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import rest_state
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.engine.estimation import predictor
from observer_rt.engine.estimation.parameters import nothing_learned
from observer_rt.engine.estimation.phases import AFTERGLOW, EDGE
from observer_rt.engine.estimation.predictor import GainSchedule, Setting, Window
from observer_rt.foundation.units import Bools, Floats, Ints
from observer_rt.identification.likelihood.events import shut_mask
from observer_rt.identification.likelihood.measurement import Measurement, Rows
from observer_rt.identification.likelihood.true_inputs import TrueInputs
from observer_rt.model.effective import Clock, Coefficients, EffectiveModel

START_MEAN = 0.05e-3  # s on either side of the start over which y is averaged

ShotDelays = Sequence[Floats]  # (k, 2) of the k shots of every event [s]
Bounds = Ints
Run = Callable[[ShotDelays], tuple[Floats, Floats]]
"""Innovations (n,) and injection rate (n,) of a model whose shots have these delays."""
DELAY_STEP = 5e-6  # s, of the finite difference by a delay
LEAST_JITTER, WIDEST_JITTER = 12e-6, 60e-6  # s, standard deviations between which that of the jitter lies
MOST_SIGMAS = 5.0  # standard deviations, up to which a delay is followed
ROUNDS = 2  # in which delays are found, the second beginning where the first led


class Batch(NamedTuple):
    """All windows of a recording, one after another; n samples in w windows, normalised by (24), as in `Window`."""

    inputs: Floats  # (n, 2)
    output: Floats  # (n,)
    resting: Bools  # (n,)
    starts: Floats  # (w, states + 1)
    bounds: Ints  # (w + 1,) window i is [bounds[i], bounds[i+1])
    openings: Ints  # (w,) in the window
    knots: Floats  # (n, 2) or (0, 2)
    clocks: Floats  # (w, 2) as of `Clock`
    commands: tuple[Floats, ...] = ()  # of a needle that is free

    def window(self, number: int) -> Window:
        """A window by its number."""
        part = slice(self.bounds[number], self.bounds[number + 1])
        signals = self.inputs[part], self.output[part], self.resting[part]
        start, clock = self.starts[number], Clock(*self.clocks[number])
        commands = self.commands[number] if self.commands else predictor.NO_COMMANDS
        return Window(*signals, start, self.openings[number], self.knots[part], clock=clock, commands=commands)


def batch_of(
    measurement: Measurement, rows: Rows, inputs: TrueInputs, samples_late: int, offset: float, c: Coefficients
) -> Batch:
    """The windows with the line pressure `samples_late` and an offset [Pa]; all candidates have the same rows."""
    recording = measurement.recording
    openings = [o for event in measurement.events for o in event.openings]
    resting = shut_mask(recording, openings)
    resting &= inputs.area <= 0.0  # the sensor does not see the foot of a ramp
    source = rows.samples - samples_late
    output = (recording.line_pressure - c.chamber_pressure) / c.pressure_scale
    return Batch(
        np.ascontiguousarray(np.stack((inputs.rail[source], inputs.area[source]), axis=1)),
        output[rows.samples],
        resting[source],
        starts_of(measurement, offset, c),
        rows.bounds,
        np.array([event.openings[0].first - event.start + samples_late for event in measurement.events]),
        inputs.knots[source] if inputs.knots.size else inputs.knots,
        np.array([event.clock for event in measurement.events]),
        tuple(commands[measurement.shots_in(event)] - event.start + samples_late for event in measurement.events)
        if measurement.is_free and (commands := measurement.commands) is not None
        else (),
    )


def starts_of(measurement: Measurement, offset: float, c: Coefficients) -> Floats:
    """States at rest (w, states + 1) with which the windows begin, the line pressure read with an offset [Pa]."""
    line, lead = measurement.recording.line_pressure, round(START_MEAN * measurement.recording.sample_rate)
    starts = np.zeros((len(measurement.events), c.states + 1))
    for i, event in enumerate(measurement.events):
        near = line[event.start - lead : event.start + lead + 1]
        mean = float(np.mean((near - c.chamber_pressure) / c.pressure_scale))
        starts[i, -1] = mean - offset / c.pressure_scale
        rest_state(starts[i, :-1], starts[i, -1], c)
    return starts


def schedule_of(measurement: Measurement, model: EffectiveModel) -> GainSchedule:
    """Gains of x~ on a recording, whose line pressure a model's sensor shows late by some share of a sample."""
    c, sensor, interval = measurement.coefficients_of(model), model.sensor, measurement.interval
    share, rate, smoothing = (
        (sensor.delay / interval) % 1.0,
        measurement.recording.sample_rate,
        predictor.smoothing_of(interval),
    )
    return predictor.gain_schedule(c, measurement.noise, rate, sensor.lag, share, rail_smoothing=smoothing)


def setting_of(
    measurement: Measurement, model: EffectiveModel, samples_late: int, substeps: int, gain: Floats
) -> Setting:
    """Setting of a model for the windows when the line pressure is recorded `samples_late` whole samples late."""
    c, sensor = measurement.coefficients_of(model), model.sensor
    share, offset = sensor.delay / measurement.interval - samples_late, sensor.offset / c.pressure_scale
    return Setting(measurement.interval, substeps, c, gain.copy(), share, sensor.lag, offset, model.program)


def followed(
    batch: Batch, setting: Setting, needle: NeedleLaw, until_opening: bool = False, delays: ShotDelays = ()
) -> tuple[Floats, Floats]:
    """Normalised innovations, rate [m3/s] (n,) of x~ over a recording's windows; until_opening: then open loop."""
    learned = nothing_learned(setting.coefficients)
    innovation, rate = np.empty((2, batch.output.size))
    for number, (first, end) in enumerate(pairwise(batch.bounds)):
        window, part = batch.window(number), slice(first, end)
        if batch.commands:
            window = window.with_jitter(delays[number] if delays else np.zeros(0), setting.interval)
            window = window._replace(needle=needle).as_learned(learned, setting)
        corrected = window.opening if until_opening else end - first
        follow(window, setting, learned, corrected, innovation[part], rate[part], None, predictor.NO_SLOPES)
    return innovation, rate


def phases(measurement: Measurement, batch: Batch) -> NDArray[np.int8]:
    """`Phase` of every row of a batch (n,)."""
    edge, afterglow = (round(t / measurement.interval) for t in (EDGE, AFTERGLOW))
    windows = [batch.window(i) for i in range(len(measurement.events))]
    return np.concatenate([phases_of(window, edge, afterglow) for window in windows])


class ShotJitter:
    """Delays of the shots in one recording."""

    def __init__(self, commands: Sequence[Floats], counted: Bools, bounds: Bounds) -> None:
        """commands: of every event (k, 2); counted: judged innovations; bounds (events + 1,): of events in these."""
        self.nominal_delays = [np.zeros_like(of_event) for of_event in commands]  # (k, 2) by the nominal model [s]
        self.sigma = LEAST_JITTER  # standard deviation of the delays [s]
        self.by_shots = np.empty((0, 0))  # (n, columns) slopes of the judged innovations by a shot of every event
        self._counted, self._bounds = counted, bounds

    def observe(self, run: Run, innovation_sigma: float) -> None:
        """Set the delays to those that a run of the nominal model shows beside their mean, sigma to their scatter."""
        here = run(self.nominal_delays)[0]
        self.by_shots = self._derivatives(run, here, self.nominal_delays)
        moved = self.by_shots * (WIDEST_JITTER / innovation_sigma)
        z, on_time = here[self._counted] / innovation_sigma, np.zeros(moved.shape[1])
        seen = WIDEST_JITTER * np.array(likelier_delays(z, [on_time] * len(self.nominal_delays), moved, self._bounds))
        for delays, later in zip(self.nominal_delays, seen - np.mean(seen, axis=0), strict=True):
            delays += later[: delays.size].reshape(-1, 2)
        squares = sum(float(np.sum(delays**2)) for delays in self.nominal_delays)
        self.sigma = max(LEAST_JITTER, math.sqrt(squares / max(np.size(seen) - len(seen[0]), 1)))

    def likely(
        self, run: Run, innovation_sigma: float, normalised: Callable[[Floats], Floats]
    ) -> tuple[list[Floats], Floats]:
        """Likeliest delays (columns,) of every event beyond the nominal ones, in standard deviations.

        Also, by how much one standard deviation of each moves the judged, `normalised` innovations (n, columns).
        """
        delays = [np.zeros(self.by_shots.shape[1]) for _ in self.nominal_delays]
        shots: ShotDelays = self.nominal_delays
        moved = self.by_shots * (self.sigma / innovation_sigma)
        for number in range(ROUNDS):
            here, _ = run(shots)
            if number:
                moved = self._derivatives(run, here, shots) * (self.sigma / innovation_sigma)
            delays = likelier_delays(normalised(here), delays, moved, self._bounds)
            shots = self.shots(delays)
        return delays, moved

    def shots(self, delays: Sequence[Floats]) -> ShotDelays:
        """Delays [s] of all shots with further ones (columns,) of every event, in standard deviations."""
        moves = [self.sigma * np.clip(of_event, -MOST_SIGMAS, MOST_SIGMAS) for of_event in delays]
        pairs = zip(self.nominal_delays, moves, strict=True)
        return [nominal + move[: nominal.size].reshape(-1, 2) for nominal, move in pairs]

    def _derivatives(self, run: Run, here: Floats, shots: ShotDelays) -> Floats:
        moved = [run(later)[0] - here for later in a_step_later(shots)]
        return np.asarray(np.column_stack(moved)[self._counted] / DELAY_STEP)


def a_step_later(shots: ShotDelays) -> list[ShotDelays]:
    """The delays of shots, each time with one delay of every event longer by `DELAY_STEP`: column after column."""
    columns = range(max((delays.size for delays in shots), default=0))
    numbers = [np.arange(of_event.size).reshape(-1, 2) for of_event in shots]
    return [[one + DELAY_STEP * (column == n) for one, n in zip(shots, numbers, strict=True)] for column in columns]


def likelier_delays(z: Floats, delays: Sequence[Floats], moved: Floats, bounds: Bounds) -> list[Floats]:
    """Delays (columns,) of the shots of every event, in standard deviations, by innovations at others (n,)."""
    results = []
    for delay, first, end in zip(delays, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        by_shots = moved[first:end]
        information = by_shots.T @ by_shots + np.eye(delay.size)
        results.append(delay - np.linalg.solve(information, by_shots.T @ z[first:end] + delay))
    return results


def without_jitter(z: Floats, delays: Sequence[Floats], moved: Floats, bounds: Bounds) -> tuple[Floats, float]:
    """White innovations (n,), and the sum of the logarithms of their standard deviations beyond 1.

    z (n,): at the likely delays; moved (n, columns): by one standard deviation of each. Exact for Gaussian ones.
    """
    result, logs = z.copy(), 0.0
    for delay, first, end in zip(delays, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        by_shots = moved[first:end]
        variances, axes = np.linalg.eigh(by_shots.T @ by_shots)
        spread = np.sqrt(1.0 + np.maximum(variances, 0.0))
        along = axes.T @ (by_shots.T @ z[first:end])
        result[first:end] -= by_shots @ (axes @ ((along / (1.0 + spread) + axes.T @ delay) / spread))
        logs += float(np.sum(np.log(spread)))
    return result, logs
