"""Likelihood of a model given recordings: whitened innovations, -2 log L, by phase."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import InputTerms, Seat
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.engine.estimation.gain import GainSchedule, gain_schedule
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics, phase_statistics
from observer_rt.engine.stream.state import noise_gain
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MM3_PER_MS
from observer_rt.identification.likelihood import windows
from observer_rt.identification.likelihood.bounded_fit import Residuals
from observer_rt.identification.likelihood.channel_noise import LiftNoise, rail_on_time, smoothing_of
from observer_rt.identification.likelihood.commands import likelier_delays, without_jitter
from observer_rt.identification.likelihood.measurement import MARGIN, Measurement
from observer_rt.identification.likelihood.open_loop import SPARE_SUBSTEPS
from observer_rt.model.baseline import HealthyShape
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.stability import MAX_SUBSTEPS, in_stable_cells, substeps_needed

GAIN_ERROR = 0.005  # standard deviation of a measured rate's gain, once a recording
METER_ERROR = 0.05  # of the time constants of its meter
VOLUME_ERROR = 0.002  # and of what it makes of an event, beyond noise
JITTER_STEP = 5e-6  # s, for a slope
LEAST_JITTER, WIDEST_JITTER, JITTER_ROUNDS = 12e-6, 60e-6, 2  # s, standard deviations, of what is looked for
MOST_JITTER = 5.0  # standard deviations, that a shot is followed
_MOST_GAINS = 4096  # cached: those round a few candidates


Run = Callable[..., tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Innovations and rate of a model, with the shots later by as much as is given."""


@dataclass(frozen=True, eq=False)
class JudgedModel:
    """A model on one recording: normalised innovations (n,) where counted, log of their standard deviation, and
    normalised residuals of the measured rate (m,), and of its integral over every event (events,), the gain error
    taken out and appended; (0,) without a rate. rate_log_sigma: of the standard deviation of the former, beyond that
    without a lag of the lift; masses: injected in every event by x~ (events,) [kg]; late: mean square of how late
    shots answer, in standard deviations, 0 where the lift was measured."""

    z: NDArray[np.float64]
    log_sigma: float
    rate_z: NDArray[np.float64]
    volume_z: NDArray[np.float64]
    rate_log_sigma: float
    masses: NDArray[np.float64]
    late: float = 0.0


class RecordingLikelihood:
    """Likelihood of models given one recording."""

    def __init__(
        self, measurement: Measurement, nominal: EffectiveModel, healthy: HealthyShape | None = None
    ) -> None:
        """healthy: mean innovation of the healthy injector, which is taken out."""
        self.measurement = measurement
        self._expected = None if healthy is None else windows.expected_of(healthy, measurement)
        nominal = measurement.as_recorded(nominal)
        self._highest_pressure = float(np.nanmax(measurement.recording.rail_pressure))
        self._rows = windows.Rows(measurement)
        self._latest = round(MARGIN / measurement.interval)  # samples by which the line pressure may be late
        rate = measurement.recording.sample_rate
        needed = substeps_needed(nominal.injector, rate, nominal.departures)
        self._substeps = max(needed, min(needed + SPARE_SUBSTEPS, MAX_SUBSTEPS))
        self._gains: dict[tuple[Any, float, float], GainSchedule] = {}
        self._nominal = nominal
        self._nominal_rail = rail_on_time(measurement, nominal.inputs)
        self._nominal_key = _input_key(nominal)
        self._nominal_inputs = self._inputs(measurement, nominal)
        c = measurement.coefficients_of(nominal)
        self._batch = windows.batch_of(measurement, self._rows, self._nominal_inputs, 0, nominal.sensor.offset, c)
        self._begins, self._normalised_by = (nominal.sensor.offset, c), (c.chamber_pressure, c.pressure_scale)
        self._late = [np.zeros_like(commands) for commands in self._batch.commands]
        self._jitter = LEAST_JITTER
        for _ in range(JITTER_ROUNDS if self._late else 0):
            self._see_jitter(nominal)
        every = windows.phases(measurement, self._batch)
        self.phases = every[self._rows.counted]
        """(n,): of the counted innovations."""
        self.rate_phases = np.zeros(0, np.int8)
        """(m,): of the judged samples of the measured rate; (0,) without one."""
        self._rate: NDArray[np.float64] | None = None
        if measurement.recording.injection_rate is not None:
            self.rate_phases = every[self._rows.rate_rows]
            self._rate = measurement.recording.injection_rate[self._rows.rate_samples]
            self._rate_by_lift = self._rate_noise_by_lift(nominal)
            self._rate_sigma = self._rate_sigma_at(0.0)

    def _see_jitter(self, nominal: EffectiveModel) -> None:
        """Move shots to where they are seen beside the mean of all: innovations go straight only so far.

        Their scatter, where it is larger than usual, counts for the jitter.
        """
        schedule = self._schedule(nominal)
        run = self._run(nominal, schedule)
        here, counted = run()[0], self._rows.counted_bounds
        self._by_shots = self._by_delays(run, here, self._late)
        by_shots = self._by_shots * (WIDEST_JITTER / schedule.innovation_sigma)
        z, on_time = here[self._rows.counted] / schedule.innovation_sigma, np.zeros(by_shots.shape[1])
        seen = WIDEST_JITTER * np.array(likelier_delays(z, [on_time] * len(self._late), by_shots, counted))
        for delays, moved in zip(self._late, seen - np.mean(seen, axis=0), strict=True):
            delays += moved[: delays.size].reshape(-1, 2)
        squares = sum(float(np.sum(delays**2)) for delays in self._late)
        self._jitter = max(LEAST_JITTER, math.sqrt(squares / max(np.size(seen) - len(seen[0]), 1)))

    @cached_property
    def _lift_noise(self) -> LiftNoise:
        """Made when a lag asks for it: it refers back, and a circle stays in memory for long."""
        return LiftNoise(self.measurement, self._with_lift_lag)

    def judge(self, model: EffectiveModel) -> JudgedModel | None:
        """Compare with a model; None where its solution is not finite or cannot be had."""
        measurement = self.measurement
        stable = in_stable_cells(measurement.as_recorded(model), measurement.interval, self._highest_pressure)
        if stable is None:
            return None
        model = stable
        late = math.floor(model.sensor.delay / self.measurement.interval)
        substeps = self._substeps_of(model)
        if abs(late) >= self._latest or substeps > MAX_SUBSTEPS:
            return None
        schedule = self._schedule(model)
        run = self._run(model, schedule)
        log_sigma = math.log(schedule.innovation_sigma)
        delays, moved = self._likely(run, model, schedule) if self._late else ([], np.empty((0, 0)))
        innovation, rate = run(self._delayed(delays))
        z = self._normalised(innovation, model, schedule)
        if not (np.isfinite(z).all() and np.isfinite(moved).all()):
            return None
        if self._late:
            z, logs = without_jitter(z, delays, moved, self._rows.counted_bounds)
            log_sigma += logs / z.size
        if model.inputs.lift_lag > 0.0:
            variance = 1.0 + self._lift_noise.variance(model.inputs.lift_lag)
            z /= np.sqrt(variance)
            log_sigma += 0.5 * float(np.mean(np.log(variance)))
        masses = model.coefficients.density * self._rows.volumes(rate)
        shown = windows.as_by_meter(self.measurement, rate)
        rate_z, rate_log_sigma = self._judged_rate(shown[self._rows.rate_rows + late], model.inputs.lift_lag)
        volume_z = self._judged_volumes(self._rows.volumes(shown))
        answered = float(np.mean(np.square(delays))) if self._late else 0.0
        return JudgedModel(z, log_sigma, rate_z, volume_z, rate_log_sigma, masses, answered)

    def late_shots(self, model: EffectiveModel) -> windows.LateShots:
        """Delays [s] of the shots of every event beyond those of a model's needle, as they are likeliest."""
        schedule = self._schedule(model)
        likely = self._delayed(self._likely(self._run(model, schedule), model, schedule)[0])
        return likely if all(np.isfinite(of).all() for of in likely) else self._late

    def _run(self, model: EffectiveModel, schedule: GainSchedule) -> Run:
        late = math.floor(model.sensor.delay / self.measurement.interval)
        return partial(self._predicted, model, self._inputs_of(model), late, schedule, self._substeps_of(model))

    def _likely(
        self, run: Run, model: EffectiveModel, schedule: GainSchedule
    ) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        """Likely delays of each event's shots, and by what one standard deviation moves innovations (n, columns)."""
        delays = [np.zeros(self._by_shots.shape[1]) for _ in self._late]
        shots: windows.LateShots = self._late
        moved = self._by_shots * (self._jitter / schedule.innovation_sigma)
        for number in range(JITTER_ROUNDS):
            here, _ = run(shots)
            if number:
                moved = self._by_delays(run, here, shots) * (self._jitter / schedule.innovation_sigma)
            z = self._normalised(here, model, schedule)
            delays = likelier_delays(z, delays, moved, self._rows.counted_bounds)
            shots = self._delayed(delays)
        return delays, moved

    def _by_delays(self, run: Run, here: NDArray[np.float64], shots: windows.LateShots) -> NDArray[np.float64]:
        """Derivatives of counted innovations (n, columns) by the delays [s] of a shot of every event."""
        moved = [run(later)[0] - here for later in _later(shots)]
        return np.asarray(np.column_stack(moved)[self._rows.counted] / JITTER_STEP)

    def _normalised(
        self, innovation: NDArray[np.float64], model: EffectiveModel, schedule: GainSchedule
    ) -> NDArray[np.float64]:
        """Counted innovations in standard deviations, beside what a healthy injector leaves."""
        z = innovation[self._rows.counted] / schedule.innovation_sigma
        if self._expected is not None:
            z -= self._expected / (schedule.innovation_sigma * model.coefficients.pressure_scale)
        return np.asarray(z)

    def _delayed(self, delays: Sequence[NDArray[np.float64]]) -> windows.LateShots:
        """Delays of the shots with so much more of each event's (columns,), in standard deviations."""
        moves = [self._jitter * np.clip(of, -MOST_JITTER, MOST_JITTER) for of in delays]
        return [late + move[: late.size].reshape(-1, 2) for late, move in zip(self._late, moves, strict=True)]

    @property
    def times(self) -> NDArray[np.float64]:
        """(n,): of the counted innovations [s], on the clock of laws."""
        events, interval = self.measurement.events, self.measurement.interval
        return np.concatenate(
            [e.clock.time + interval * np.arange(e.counted - e.start, e.end - e.start) for e in events]
        )

    def _predicted(
        self,
        model: EffectiveModel,
        inputs: windows.TrueInputs,
        late: int,
        schedule: GainSchedule,
        substeps: int,
        shots: windows.LateShots = (),
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Innovations and rate of all rows, the line pressure recorded `late` whole samples late."""
        c, offset = self.measurement.coefficients_of(model), model.sensor.offset
        is_nominal = inputs is self._nominal_inputs and (c.chamber_pressure, c.pressure_scale) == self._normalised_by
        if late or not is_nominal:
            batch = windows.batch_of(self.measurement, self._rows, inputs, late, offset, c)
        elif (offset, c) == self._begins:  # of nearly all models: those that differ by a law
            batch = self._batch
        else:
            batch = self._batch._replace(starts=windows.starts_of(self.measurement, offset, c))
        setting = windows.setting_of(self.measurement, model, late, substeps, schedule.gains[-1])
        innovation, rate = windows.followed(batch, setting, model.injector.needle_law, late=shots or self._late)
        return innovation, windows.rate_as_recorded(self.measurement, rate)

    def _with_lift_lag(self, measurement: Measurement, lag: float) -> NDArray[np.float64]:
        """Normalised innovations (n,), where counted, of the nominal model with a lag [s] of the lift undone.

        measurement: this recording, or with other noise in its lift.
        """
        model, schedule = self._nominal.with_terms("inputs", lift_lag=lag), self._schedule(self._nominal)
        inputs = self._inputs(measurement, model)
        innovation, _ = self._predicted(model, inputs, 0, schedule, self._substeps_of(model))
        return np.asarray(innovation[self._rows.counted] / schedule.innovation_sigma)

    def _substeps_of(self, model: EffectiveModel) -> int:
        if (model.injector, model.departures) == (self._nominal.injector, self._nominal.departures):
            return self._substeps  # of all that differ by laws, or by the bench
        rate = self.measurement.recording.sample_rate
        return max(self._substeps, substeps_needed(model.injector, rate, model.departures))

    def _schedule(self, model: EffectiveModel) -> GainSchedule:
        c, sensor = self.measurement.coefficients_of(model), model.sensor
        share = (sensor.delay / self.measurement.interval) % 1.0
        key = (c.line, sensor.lag, share)
        schedule = self._gains.get(key)
        if schedule is None:
            if len(self._gains) > _MOST_GAINS:
                self._gains.clear()
            rate = self.measurement.recording.sample_rate
            smoothing = smoothing_of(self.measurement.interval)
            schedule = gain_schedule(c, self.measurement.noise, rate, sensor.lag, share, rail_smoothing=smoothing)
            schedule = replace(schedule, gains=schedule.gains[-1:].copy())  # hundreds of rows else, of each model
            self._gains[key] = schedule
        return schedule

    def _inputs_of(self, model: EffectiveModel) -> windows.TrueInputs:
        """True inputs under the model's terms; only the nominal ones are cached."""
        if _input_key(model) == self._nominal_key:
            return self._nominal_inputs
        return self._inputs(self.measurement, model)

    def _inputs(self, measurement: Measurement, model: EffectiveModel) -> windows.TrueInputs:
        c = measurement.coefficients_of(model)
        return windows.TrueInputs(measurement, model.inputs, c, self._rail(model.inputs), model.injector.needle_law)

    def _rail(self, terms: InputTerms) -> NDArray[np.float64]:
        """Rail pressure on time; only that of the nominal delay is cached."""
        if terms.rail_delay == self._nominal.inputs.rail_delay:
            return self._nominal_rail
        return rail_on_time(self.measurement, terms)

    def _rate_noise_by_lift(self, nominal: EffectiveModel) -> NDArray[np.float64]:
        """Standard deviation of the modelled rate (m,) by the noise of the lift as recorded, and by the meter."""
        noise = self.measurement.noise.needle_lift
        schedule = self._schedule(nominal)
        shifted = nominal.with_terms("inputs", lift_shift=nominal.inputs.lift_shift + noise)
        late = math.floor(nominal.sensor.delay / self.measurement.interval)
        substeps = self._substeps_of(nominal)
        _, rate = self._predicted(nominal, self._nominal_inputs, late, schedule, substeps)
        _, other = self._predicted(shifted, self._inputs_of(shifted), late, schedule, substeps)
        moved = windows.as_by_meter(self.measurement, other - rate)
        for shots in _later(self._late):
            _, other = self._predicted(nominal, self._nominal_inputs, late, schedule, substeps, shots)
            moved = np.hypot(moved, self._jitter / JITTER_STEP * windows.as_by_meter(self.measurement, other - rate))
        moved = np.hypot(moved, METER_ERROR * (rate - windows.as_by_meter(self.measurement, rate)))
        return np.asarray(moved[self._rows.rate_rows + late], np.float64)

    def _rate_sigma_at(self, lift_lag: float) -> NDArray[np.float64]:
        """Standard deviation of measured minus modelled rate (m,): its own noise and that of the restored lift."""
        by_lift = noise_gain(lift_lag / self.measurement.interval) * self._rate_by_lift
        return np.asarray(np.hypot(self.measurement.rate_noise, by_lift), np.float64)

    def _judged_rate(self, rate: NDArray[np.float64], lift_lag: float) -> tuple[NDArray[np.float64], float]:
        """Residuals of the measured rate, its gain error estimated with its prior: exact for a Gaussian nuisance.

        And by how much a lag of the lift makes the logarithm of their standard deviation larger, on average.
        """
        if self._rate is None:
            return np.zeros(0), 0.0
        sigma = self._rate_sigma_at(lift_lag) if lift_lag > 0.0 else self._rate_sigma
        larger = float(np.mean(np.log(sigma / self._rate_sigma)))
        return _without_gain_error(self._rate, rate, sigma), larger

    def _judged_volumes(self, volumes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residuals of the measured rate's integrals beside those (events,) of the model's as the meter shows it."""
        measured = self.measurement.recording.injection_rate
        if measured is None:
            return np.zeros(0)
        noise, samples = self.measurement.rate_noise, self._rows.volumes(np.ones(self._rows.samples.size))
        sigma = np.hypot(noise * np.sqrt(samples * self.measurement.interval), VOLUME_ERROR * volumes)
        return _without_gain_error(self._rows.volumes(measured[self._rows.samples]), volumes, sigma)


def _without_gain_error(
    measured: NDArray[np.float64], modelled: NDArray[np.float64], sigma: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Normalised residuals of what was measured with a gain error, and that over its own standard deviation."""
    residual, scale = (measured - modelled) / sigma, modelled / sigma
    gain = float(scale @ residual) / (float(scale @ scale) + GAIN_ERROR**-2)
    return np.append(residual - gain * scale, gain / GAIN_ERROR)


def joint_likelihood(
    recordings: Sequence[Measurement], nominal: EffectiveModel, healthy: HealthyShape | None = None
) -> "JointLikelihood":
    """Recordings, ready to be compared with models that depart from the nominal one.

    healthy: mean innovation of the healthy injector by the nominal model, which is taken out.

    Raises `UserError` where the nominal model needs too many integration steps a sample.
    """
    for measurement in recordings:
        rate = measurement.recording.sample_rate
        substeps = substeps_needed(nominal.injector, rate, nominal.departures)
        if substeps > MAX_SUBSTEPS:
            raise UserError(
                str(measurement.recording.path or "recording"),
                f"{rate:g} Hz would need {substeps} integration steps a sample (at most {MAX_SUBSTEPS})",
                f"record with {rate * substeps / MAX_SUBSTEPS:.0f} Hz or more, or give the model a larger sac",
            )
    return JointLikelihood([RecordingLikelihood(measurement, nominal, healthy) for measurement in recordings])


class JointLikelihood:
    """Likelihood of models given all recordings."""

    def __init__(self, recordings: Sequence[RecordingLikelihood]) -> None:
        self.recordings = tuple(recordings)

    def judge(self, model: EffectiveModel) -> list[JudgedModel] | None:
        """The model on every recording; None where its solution is not finite."""
        judged = [recorded.judge(model) for recorded in self.recordings]
        complete = [one for one in judged if one is not None]
        return complete if len(complete) == len(judged) else None

    def residuals(self, model: EffectiveModel) -> Residuals | None:
        """All residuals: line pressure, then rate, recording after recording."""
        judged = self.judge(model)
        return None if judged is None else residuals_of(judged)


def _later(shots: windows.LateShots) -> list[windows.LateShots]:
    """Delays of the shots, one of a shot of every event later by a step: its opening, then its closing."""
    columns = range(max((late.size for late in shots), default=0))
    return [
        [late + JITTER_STEP * (column == np.arange(late.size).reshape(-1, 2)) for late in shots] for column in columns
    ]


def residuals_of(judged: Sequence[JudgedModel]) -> Residuals:
    """Residuals of all recordings as one."""
    return Residuals.of(
        [part for one in judged for part in ((one.z, one.log_sigma), (one.rate_z, one.rate_log_sigma))]
    )


def _input_key(model: EffectiveModel) -> tuple[InputTerms, Seat, NeedleLaw]:
    """Terms that the inputs depend on."""
    return model.inputs, model.coefficients.seat, model.injector.needle_law


class Signal(StrEnum):
    """A signal whose innovations are judged."""

    LINE_PRESSURE = "line_pressure"
    INJECTION_RATE = "injection_rate"

    @property
    def unit(self) -> str:
        """It is printed in."""
        return "MPa" if self is Signal.LINE_PRESSURE else "mm3/ms"

    @property
    def si(self) -> float:
        """One of that unit in SI."""
        return MEGAPASCAL if self is Signal.LINE_PRESSURE else MM3_PER_MS

    @property
    def words(self) -> str:
        """For people."""
        return self.value.replace("_", " ")


Pool = Mapping[Signal, PhaseStatistics]
"""Statistics of each signal, pooled over recordings."""


def normalised(judged_model: JudgedModel) -> dict[Signal, NDArray[np.float64]]:
    """Normalised residuals by signal, without the rate's gain error at the end."""
    parts = {Signal.LINE_PRESSURE: judged_model.z}
    if judged_model.rate_z.size:
        parts[Signal.INJECTION_RATE] = judged_model.rate_z[:-1]
    return parts


def phases_by_signal(recorded: RecordingLikelihood) -> dict[Signal, NDArray[np.int8]]:
    return {Signal.LINE_PRESSURE: recorded.phases, Signal.INJECTION_RATE: recorded.rate_phases}


def pool_of(recordings: Sequence[RecordingLikelihood], judged: Sequence[JudgedModel]) -> Pool:
    """Statistics of all recordings together."""
    pool: dict[Signal, PhaseStatistics] = {}
    for recorded, judged_model in zip(recordings, judged, strict=True):
        for signal, z in normalised(judged_model).items():
            statistics = phase_statistics(z, 1.0, phases_by_signal(recorded)[signal], 0)
            pool[signal] = pool.get(signal, no_statistics()).faded(1.0, statistics)
    return pool
