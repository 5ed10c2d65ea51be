"""The judged stretches of a recording as windows of the predictor, and the predictor run through them."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.phases import phases_of
from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import rest_state
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.engine.estimation.gain import GainSchedule, gain_schedule
from observer_rt.engine.estimation.phases import AFTERGLOW, EDGE
from observer_rt.engine.estimation.predictor import NO_COMMANDS, NO_SLOPES, Setting, Window
from observer_rt.engine.estimation.scalars import nothing_learned
from observer_rt.identification.likelihood.events import shut_mask
from observer_rt.identification.likelihood.measurement import Measurement, Rows
from observer_rt.identification.likelihood.true_inputs import TrueInputs, smoothing_of
from observer_rt.model.effective import Clock, Coefficients, EffectiveModel

START_MEAN = 0.05e-3  # s on either side of the start over which y is averaged

ShotDelays = Sequence[NDArray[np.float64]]  # (k, 2) of the k shots of every event [s]


class Batch(NamedTuple):
    """All windows of a recording, one after another; n samples in w windows, normalised by (24), as in `Window`."""

    inputs: NDArray[np.float64]  # (n, 2)
    output: NDArray[np.float64]  # (n,)
    resting: NDArray[np.bool_]  # (n,)
    starts: NDArray[np.float64]  # (w, states + 1)
    bounds: NDArray[np.int64]  # (w + 1,) window i is [bounds[i], bounds[i+1])
    openings: NDArray[np.int64]  # (w,) in the window
    knots: NDArray[np.float64]  # (n, 2) or (0, 2)
    clocks: NDArray[np.float64]  # (w, 2) as of `Clock`
    commands: tuple[NDArray[np.float64], ...] = ()  # of a needle that is free

    def window(self, number: int) -> Window:
        """A window by its number."""
        part = slice(self.bounds[number], self.bounds[number + 1])
        signals = self.inputs[part], self.output[part], self.resting[part]
        start, clock = self.starts[number], Clock(*self.clocks[number])
        commands = self.commands[number] if self.commands else NO_COMMANDS
        return Window(*signals, start, self.openings[number], self.knots[part], clock=clock, commands=commands)


def batch_of(
    measurement: Measurement, rows: Rows, inputs: TrueInputs, samples_late: int, offset: float, c: Coefficients
) -> Batch:
    """The windows when the line pressure is recorded some samples late with an offset [Pa] added.

    Rows belong to samples of the line pressure, so that every candidate is judged on the same ones.
    """
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


def starts_of(measurement: Measurement, offset: float, c: Coefficients) -> NDArray[np.float64]:
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
        smoothing_of(interval),
    )
    return gain_schedule(c, measurement.noise, rate, sensor.lag, share, rail_smoothing=smoothing)


def setting_of(
    measurement: Measurement, model: EffectiveModel, samples_late: int, substeps: int, gain: NDArray[np.float64]
) -> Setting:
    """Setting of a model for the windows when the line pressure is recorded `samples_late` whole samples late."""
    c, sensor = measurement.coefficients_of(model), model.sensor
    share, offset = sensor.delay / measurement.interval - samples_late, sensor.offset / c.pressure_scale
    return Setting(measurement.interval, substeps, c, gain.copy(), share, sensor.lag, offset, model.program)


def followed(
    batch: Batch, setting: Setting, needle: NeedleLaw, until_opening: bool = False, delays: ShotDelays = ()
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normalised innovations (n,) and injection rate [m3/s] (n,) of x~ over all windows of a recording.

    needle: answers the commands of the batch, if it has any; delays: of its shots, by jitter; until_opening: of x^
    instead, which runs open loop from the opening of its window on.
    """
    learned = nothing_learned(setting.coefficients)
    innovation, rate = np.empty((2, batch.output.size))
    for number, (first, end) in enumerate(pairwise(batch.bounds)):
        window, part = batch.window(number), slice(first, end)
        if batch.commands:
            window = window.with_jitter(delays[number] if delays else np.zeros(0), setting.interval)
            window = window._replace(needle=needle).as_learned(learned, setting)
        corrected = window.opening if until_opening else end - first
        follow(window, setting, learned, corrected, innovation[part], rate[part], None, NO_SLOPES)
    return innovation, rate


def phases(measurement: Measurement, batch: Batch) -> NDArray[np.int8]:
    """`Phase` of every row of a batch (n,)."""
    edge, afterglow = (round(t / measurement.interval) for t in (EDGE, AFTERGLOW))
    windows = [batch.window(i) for i in range(len(measurement.events))]
    return np.concatenate([phases_of(window, edge, afterglow) for window in windows])
