"""Likelihood of models given recordings: normalised innovations of each model, and residuals of a measured rate."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from observer_rt.core.model.model import InputTerms, Seat
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.engine.estimation.predictor import GainSchedule
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from observer_rt.identification.likelihood import open_loop, windows
from observer_rt.identification.likelihood.bounded_fit import Residuals
from observer_rt.identification.likelihood.events import MARGIN
from observer_rt.identification.likelihood.measurement import Measurement, Rows, expected_of
from observer_rt.identification.likelihood.true_inputs import LiftNoise, TrueInputs, rail_on_time
from observer_rt.model.baseline import HealthyShape
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.stability import MAX_SUBSTEPS, in_stable_cells, substeps_needed

_MOST_GAINS = 4096  # cached: those round a few candidates


@dataclass(frozen=True, eq=False)
class JudgedModel:
    """A model on one recording of n judged innovations."""

    z: Floats  # (n,) normalised innovations
    log_sigma: float  # logarithm of their standard deviation
    rate_z: Floats  # (k,) normalised residuals of the rate, as of `MeasuredRate`; (0,): not measured
    volume_z: Floats  # of its integral over every event
    rate_log_sigma: float  # rise of the logarithm of the rate's standard deviation by a lag of the lift
    masses: Floats  # (events,) injected [kg], by the observer's estimate
    delay_square: float = 0.0  # mean square of the delays of shots, in standard deviations; 0: the lift was measured

    @property
    def z_of_rate(self) -> Floats:
        """`rate_z` of the samples alone, without the gain's error at its end."""
        return self.rate_z[:-1]


class RecordingLikelihood:
    """Likelihood of models given one recording."""

    def __init__(
        self, measurement: Measurement, nominal: EffectiveModel, healthy: HealthyShape | None = None
    ) -> None:
        """nominal: model from which others differ little; healthy: mean innovation that is subtracted."""
        self.measurement = measurement
        self._expected = None if healthy is None else expected_of(healthy, measurement)
        nominal = measurement.as_recorded(nominal)
        self._highest_pressure = float(np.nanmax(measurement.recording.rail_pressure))
        self._rows = Rows(measurement)
        rate = measurement.recording.sample_rate
        needed = substeps_needed(nominal.injector, rate, nominal.departures)
        self._substeps = max(needed, min(needed + open_loop.SPARE_SUBSTEPS, MAX_SUBSTEPS))
        self._gains: dict[tuple[Any, float, float], GainSchedule] = {}
        self._nominal = nominal
        self._nominal_rail = rail_on_time(measurement, nominal.inputs)
        self._nominal_inputs = self._inputs(measurement, nominal)
        c = measurement.coefficients_of(nominal)
        self._batch = windows.batch_of(measurement, self._rows, self._nominal_inputs, 0, nominal.sensor.offset, c)
        self._begins, self._normalised_by = (nominal.sensor.offset, c), (c.chamber_pressure, c.pressure_scale)
        self._jitter = windows.ShotJitter(self._batch.commands, self._rows.counted, self._rows.counted_bounds)
        for _ in range(windows.ROUNDS if self._jitter.nominal_delays else 0):
            self._jitter.observe(self._run(nominal), self._schedule(nominal).innovation_sigma)
        every = windows.phases(measurement, self._batch)
        self.phases = every[self._rows.counted]  # (n,) of the judged innovations
        self.rate_phases = np.zeros(0, np.int8)  # (m,) of the judged samples of a measured rate; (0,) without one
        self._rate: open_loop.MeasuredRate | None = None
        if measurement.recording.injection_rate is not None:
            self.rate_phases = every[self._rows.rate_rows]
            self._rate = open_loop.MeasuredRate(measurement, self._rows, self._rate_noise_by_lift(nominal))

    @cached_property
    def _lift_noise(self) -> LiftNoise:
        """Made for the first model with a lag: it refers back to this object, and a circle stays in memory long."""
        return LiftNoise(self.measurement, self._with_lift_lag)

    def judge(self, model: EffectiveModel) -> JudgedModel | None:
        """Compare the recording with a model; None without a finite solution in the steps and delays there may be."""
        recorded = self.measurement.as_recorded(model)
        stable = in_stable_cells(recorded, self.measurement.interval, self._highest_pressure)
        if stable is None:
            return None
        model, samples_late = stable, self._samples_late(stable)
        if abs(samples_late) >= round(MARGIN / self.measurement.interval) or self._substeps_of(model) > MAX_SUBSTEPS:
            return None
        log_sigma = math.log(self._schedule(model).innovation_sigma)
        run = self._run(model)
        delays, moved = self._likely_delays(run, model)
        innovation, rate = run(self._jitter.shots(delays))
        z = self._normalised(innovation, model)
        if not (np.isfinite(z).all() and np.isfinite(moved).all()):
            return None
        if delays:
            z, logs = windows.without_jitter(z, delays, moved, self._rows.counted_bounds)
            log_sigma += logs / z.size
        if model.inputs.lift_lag > 0.0:
            variance = 1.0 + self._lift_noise.variance(model.inputs.lift_lag)
            z /= np.sqrt(variance)
            log_sigma += 0.5 * float(np.mean(np.log(variance)))
        masses = model.coefficients.density * self._rows.volumes(rate)
        shown = open_loop.as_by_meter(self.measurement, rate)
        rate_z, volume_z, rate_log_sigma = np.zeros(0), np.zeros(0), 0.0
        if self._rate is not None:
            judged_rate = shown[self._rows.rate_rows + samples_late]
            rate_z, rate_log_sigma = self._rate.residuals(judged_rate, model.inputs.lift_lag)
            volume_z = self._rate.volume_residuals(self._rows.volumes(shown))
        mean_square = float(np.mean(np.square(delays))) if delays else 0.0
        return JudgedModel(z, log_sigma, rate_z, volume_z, rate_log_sigma, masses, mean_square)

    def late_shots(self, model: EffectiveModel) -> windows.ShotDelays:
        """Likeliest delays [s] (k, 2) of the shots of every event, beyond those of a model's needle."""
        likely = self._jitter.shots(self._likely_delays(self._run(model), model)[0])
        return likely if all(np.isfinite(delays).all() for delays in likely) else self._jitter.nominal_delays

    def _likely_delays(self, run: windows.Run, model: EffectiveModel) -> tuple[list[Floats], Floats]:
        if not self._jitter.nominal_delays:
            return [], np.empty((0, 0))
        sigma = self._schedule(model).innovation_sigma
        return self._jitter.likely(run, sigma, partial(self._normalised, model=model))

    def _normalised(self, innovation: Floats, model: EffectiveModel) -> Floats:
        """Judged innovations in standard deviations, less the healthy injector's mean."""
        sigma = self._schedule(model).innovation_sigma
        z = innovation[self._rows.counted] / sigma
        if self._expected is not None:
            z -= self._expected / (sigma * model.coefficients.pressure_scale)
        return np.asarray(z)

    @property
    def times(self) -> Floats:
        """Times (n,) of the judged innovations [s], on the clock of laws."""
        counted = [(e.clock.time, np.arange(e.counted - e.start, e.end - e.start)) for e in self.measurement.events]
        return np.concatenate([start + self.measurement.interval * samples for start, samples in counted])

    def _run(self, model: EffectiveModel) -> windows.Run:
        inputs, samples_late = self._inputs_of(model), self._samples_late(model)
        return partial(self._predicted, model, inputs, samples_late, self._substeps_of(model))

    def _predicted(
        self,
        model: EffectiveModel,
        inputs: TrueInputs,
        samples_late: int,
        substeps: int,
        shots: windows.ShotDelays = (),
    ) -> tuple[Floats, Floats]:
        """Innovations and rate of all rows, the line pressure recorded `samples_late` whole samples late."""
        measurement, c, offset = self.measurement, self.measurement.coefficients_of(model), model.sensor.offset
        is_nominal = inputs is self._nominal_inputs and (c.chamber_pressure, c.pressure_scale) == self._normalised_by
        if samples_late or not is_nominal:
            batch = windows.batch_of(measurement, self._rows, inputs, samples_late, offset, c)
        elif (offset, c) == self._begins:  # of nearly all models: those that differ by a law
            batch = self._batch
        else:
            batch = self._batch._replace(starts=windows.starts_of(measurement, offset, c))
        setting = windows.setting_of(measurement, model, samples_late, substeps, self._schedule(model).gains[-1])
        delays = shots or self._jitter.nominal_delays
        innovation, rate = windows.followed(batch, setting, model.injector.needle_law, delays=delays)
        return innovation, open_loop.rate_as_recorded(measurement, rate)

    def _with_lift_lag(self, measurement: Measurement, lag: float) -> Floats:
        """Normalised judged innovations (n,) with a lag [s] of the lift undone, which may have other noise."""
        model = self._nominal.with_changes("inputs", lift_lag=lag)
        innovation, _ = self._predicted(model, self._inputs(measurement, model), 0, self._substeps_of(model))
        return np.asarray(innovation[self._rows.counted] / self._schedule(model).innovation_sigma)

    def _samples_late(self, model: EffectiveModel) -> int:
        return math.floor(model.sensor.delay / self.measurement.interval)

    def _substeps_of(self, model: EffectiveModel) -> int:
        if (model.injector, model.departures) == (self._nominal.injector, self._nominal.departures):
            return self._substeps  # of all that differ by laws, or by the bench
        rate = self.measurement.recording.sample_rate
        return max(self._substeps, substeps_needed(model.injector, rate, model.departures))

    def _schedule(self, model: EffectiveModel) -> GainSchedule:
        """Gains of x~ for a model; only the last, those of its steady state, are kept."""
        share = (model.sensor.delay / self.measurement.interval) % 1.0
        key = self.measurement.coefficients_of(model).line, model.sensor.lag, share
        schedule = self._gains.get(key)
        if schedule is None:
            if len(self._gains) > _MOST_GAINS:
                self._gains.clear()
            schedule = windows.schedule_of(self.measurement, model)
            schedule = replace(schedule, gains=schedule.gains[-1:].copy())  # hundreds of rows else, of each model
            self._gains[key] = schedule
        return schedule

    def _inputs_of(self, model: EffectiveModel) -> TrueInputs:
        """True inputs under the model's terms; only the nominal ones are cached."""
        if _input_key(model) == _input_key(self._nominal):
            return self._nominal_inputs
        return self._inputs(self.measurement, model)

    def _inputs(self, measurement: Measurement, model: EffectiveModel) -> TrueInputs:
        c, terms, rail = measurement.coefficients_of(model), model.inputs, self._nominal_rail
        if terms.rail_delay != self._nominal.inputs.rail_delay:
            rail = rail_on_time(self.measurement, terms)
        return TrueInputs(measurement, terms, c, rail, model.injector.needle_law)

    def _rate_noise_by_lift(self, nominal: EffectiveModel) -> Floats:
        """Standard deviation of the modelled rate (m,) by the recorded lift's noise, by jitter and by the meter."""
        noise = self.measurement.noise.needle_lift
        shifted = nominal.with_changes("inputs", lift_shift=nominal.inputs.lift_shift + noise)
        run, delays = self._run(nominal), self._jitter.nominal_delays
        _, rate = run(delays)
        _, other = self._run(shifted)(delays)
        moved = open_loop.as_by_meter(self.measurement, other - rate)
        for shots in windows.a_step_later(delays):
            _, other = run(shots)
            steps = self._jitter.sigma / windows.DELAY_STEP
            moved = np.hypot(moved, steps * open_loop.as_by_meter(self.measurement, other - rate))
        moved = np.hypot(moved, open_loop.METER_ERROR * (rate - open_loop.as_by_meter(self.measurement, rate)))
        return np.asarray(moved[self._rows.rate_rows + self._samples_late(nominal)], np.float64)


def joint_likelihood(
    recordings: Sequence[Measurement], nominal: EffectiveModel, healthy: HealthyShape | None = None
) -> "JointLikelihood":
    """Recordings, to judge models near the nominal one. Raises `UserError` where that needs too many steps."""
    for measurement in recordings:
        rate = measurement.recording.sample_rate
        substeps = substeps_needed(nominal.injector, rate, nominal.departures)
        if substeps > MAX_SUBSTEPS:
            problem = f"{rate:g} Hz would need {substeps} integration steps a sample (at most {MAX_SUBSTEPS})"
            remedy = f"record with {rate * substeps / MAX_SUBSTEPS:.0f} Hz or more, or give the model a larger sac"
            raise UserError(str(measurement.recording.path or "recording"), problem, remedy)
    return JointLikelihood([RecordingLikelihood(measurement, nominal, healthy) for measurement in recordings])


class JointLikelihood:
    """Likelihood of models given all recordings."""

    def __init__(self, recordings: Sequence[RecordingLikelihood]) -> None:
        self.recordings = tuple(recordings)

    def judge(self, model: EffectiveModel) -> list[JudgedModel] | None:
        """A model on every recording; None where it has no finite solution on one of them."""
        judged = [recorded.judge(model) for recorded in self.recordings]
        complete = [one for one in judged if one is not None]
        return complete if len(complete) == len(judged) else None

    def residuals(self, model: EffectiveModel) -> Residuals | None:
        """Residuals of a model on all recordings; None as of `judge`."""
        judged = self.judge(model)
        return None if judged is None else residuals_of(judged)


def residuals_of(judged: Sequence[JudgedModel]) -> Residuals:
    """Residuals of line pressure, then rate, recording after recording."""
    pairs = [((one.z, one.log_sigma), (one.rate_z, one.rate_log_sigma)) for one in judged]
    return Residuals.of([group for pair in pairs for group in pair])


def _input_key(model: EffectiveModel) -> tuple[InputTerms, Seat, NeedleLaw]:
    return model.inputs, model.coefficients.seat, model.injector.needle_law
