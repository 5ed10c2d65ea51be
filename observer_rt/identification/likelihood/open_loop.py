"""A model run through a recording: with the measurement up to an opening, open loop from the opening on.

A measured rate has a gain error, one for the whole recording, which is estimated with its prior.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated
from weakref import WeakKeyDictionary

import numpy as np

from observer_rt.engine.stream.state import noise_gain
from observer_rt.files.signals.recording import shown_slowly
from observer_rt.foundation.documents import key, unit
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, Floats, Ints
from observer_rt.identification.likelihood import windows
from observer_rt.identification.likelihood.events import JudgedEvent
from observer_rt.identification.likelihood.measurement import Measurement, Rows, in_mass_window
from observer_rt.identification.likelihood.true_inputs import TrueInputs
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.stability import in_stable_cells, substeps_needed

MOST_RUNS = 16  # runs of a recording: most models are asked for more than once
SPARE_SUBSTEPS = 1  # so that a little wear does not change their number
GAIN_ERROR = 0.005  # standard deviation of the gain
METER_ERROR = 0.05  # of the time constants of the meter
VOLUME_ERROR = 0.002  # of the integral over an event, beyond noise


@dataclass(frozen=True, eq=False)
class SimulatedInjection:
    """A model on one event: n samples from the opening to the end of the ringing, SI."""

    event: JudgedEvent
    samples: Ints  # (n,) of the recording, that the line pressure belongs to
    line_pressure: Floats
    rate_samples: Ints  # (n,) of the recording, that the rate belongs to
    rate: Floats
    shown_rate: Floats  # as its meter shows it


@dataclass(frozen=True)
class Consequence:
    """Change by a model over all events: rms of the line pressure up to the end of ringing [Pa], mean mass [kg]."""

    line_pressure: Annotated[float, key("line_pressure_rms_MPa"), unit(MEGAPASCAL)]
    mass: Annotated[float, key("injected_mass_mean_mg"), unit(MILLIGRAM)]


NO_CONSEQUENCE = Consequence(0.0, 0.0)
_Runs = list[tuple[EffectiveModel, tuple[SimulatedInjection, ...]]]
_RUNS: WeakKeyDictionary[Measurement, _Runs] = WeakKeyDictionary()


def simulated(measurement: Measurement, model: EffectiveModel) -> tuple[SimulatedInjection, ...]:
    """Line pressure as it would be recorded, and rate, of every event: by x~ up to the opening, then open loop."""
    kept = _RUNS.setdefault(measurement, [])
    for stored_model, run in tuple(kept):
        if stored_model == model:
            return run
    run = _simulated(measurement, model)
    kept[:] = [*kept[1 - MOST_RUNS :], (model, run)]
    return run


def _simulated(measurement: Measurement, effective: EffectiveModel) -> tuple[SimulatedInjection, ...]:
    interval = measurement.interval
    highest_pressure = float(np.nanmax(measurement.recording.rail_pressure))
    model = in_stable_cells(measurement.as_recorded(effective), interval, highest_pressure)
    if model is None:
        raise ArithmeticError("no number of cells is stable for this line")
    c, sensor = measurement.coefficients_of(model), model.sensor
    late, rows = math.floor(sensor.delay / interval), Rows(measurement)
    inputs = TrueInputs(measurement, model.inputs, c, needle=model.injector.needle_law)
    batch = windows.batch_of(measurement, rows, inputs, late, sensor.offset, c)
    gain = windows.schedule_of(measurement, model).gains[-1]
    substeps = substeps_needed(model.injector, measurement.recording.sample_rate, model.departures) + SPARE_SUBSTEPS
    setting = windows.setting_of(measurement, model, late, substeps, gain)
    errors, rate = windows.followed(batch, setting, model.injector.needle_law, until_opening=True)
    pressure = (batch.output - errors) * c.pressure_scale + c.chamber_pressure
    result = []
    for number, event in enumerate(measurement.events):
        window = slice(*batch.bounds[number : number + 2])
        first = event.openings[0].first - event.start
        samples = rows.samples[window][first:]
        recorded = rate_as_recorded(measurement, rate[window])
        shown = as_by_meter(measurement, recorded)[first:]
        of_line = event, samples, pressure[window][first:]
        result.append(SimulatedInjection(*of_line, samples - late, recorded[first:], shown))
    return tuple(result)


def mass(measurement: Measurement, injection: SimulatedInjection, density: float) -> float:
    """Injected mass of an event [kg]."""
    inside = in_mass_window(measurement, injection.event, injection.rate_samples)
    return float(np.trapezoid(injection.rate[inside])) * measurement.interval * density


def pressure_gap(measurement: Measurement, injection: SimulatedInjection) -> Floats:
    """Simulated minus measured line pressure of an event (n,) [Pa]."""
    return injection.line_pressure - measurement.recording.line_pressure[injection.samples]


def mean_mass(measured: Sequence[Measurement], model: EffectiveModel) -> float:
    """Mean injected mass of an event of recordings [kg]."""
    density = model.coefficients.density
    return float(np.mean([mass(each, one, density) for each in measured for one in simulated(each, model)]))


def consequence(measured: Sequence[Measurement], before: EffectiveModel, after: EffectiveModel) -> Consequence:
    """By how much line pressure and mass move from one model to another."""
    pressures, masses = [], []
    for measurement in measured:
        for old, new in zip(simulated(measurement, before), simulated(measurement, after), strict=True):
            pressures.append(new.line_pressure - old.line_pressure)
            runs = (old, before), (new, after)
            was, now = (mass(measurement, run, model.coefficients.density) for run, model in runs)
            masses.append(now - was)
    return Consequence(float(np.sqrt(np.mean(np.concatenate(pressures) ** 2))), float(np.mean(masses)))


def measured_mass(measurement: Measurement, injection: SimulatedInjection, density: float) -> float:
    """Mass of an event by the measured rate [kg], nan without one; the meter's delay is corrected by the model."""
    measured = measurement.recording.injection_rate
    if measured is None:
        return math.nan
    inside = in_mass_window(measurement, injection.event, injection.rate_samples)
    late = (injection.rate - injection.shown_rate)[inside]
    return float(np.trapezoid(measured[injection.rate_samples[inside]] + late)) * measurement.interval * density


def rate_as_recorded(measurement: Measurement, rate: Floats) -> Floats:
    """A modelled injection rate (n,) as it would be recorded: averaged over each period if samples are means."""
    if not measurement.means:
        return rate
    beyond = np.concatenate([rate[:1], rate, rate[-1:]])
    middle = 13.0 * (rate[1:] + rate[:-1]) - beyond[:-3] - beyond[3:]  # of the cubic through four samples
    return np.append(rate[:1], middle / 24.0)


def as_by_meter(measurement: Measurement, rate: Floats) -> Floats:
    """A modelled injection rate (n,) as the meter shows it; events lie so far apart that it rests before each."""
    return shown_slowly(rate, measurement.interval, *(measurement.recording.meter or ()))


class MeasuredRate:
    """The measured rate of a recording at the m judged samples, and over its events."""

    def __init__(self, measurement: Measurement, rows: Rows, by_lift: Floats) -> None:
        """by_lift: standard deviation of the modelled rate (m,) [m3/s] by lift, jitter and meter as recorded."""
        rate = measurement.recording.injection_rate
        assert rate is not None
        self._rate, self._volumes = rate[rows.rate_samples], rows.volumes(rate[rows.samples])
        self._noise, self._interval, self._by_lift = measurement.rate_noise, measurement.interval, by_lift
        self._volume_noise = self._noise * np.sqrt(rows.volumes(np.ones(rows.samples.size)) * self._interval)
        self._sigma = self._sigma_at(0.0)

    def residuals(self, rate: Floats, lift_lag: float) -> tuple[Floats, float]:
        """Residuals (m + 1,) of a modelled rate (m,), and the mean rise of log sigma by a lag of the lift [s]."""
        sigma = self._sigma_at(lift_lag) if lift_lag > 0.0 else self._sigma
        return _without_gain_error(self._rate, rate, sigma), float(np.mean(np.log(sigma / self._sigma)))

    def volume_residuals(self, volumes: Floats) -> Floats:
        """Residuals (events + 1,) of modelled integrals (events,) as the meter shows them."""
        return _without_gain_error(self._volumes, volumes, np.hypot(self._volume_noise, VOLUME_ERROR * volumes))

    def _sigma_at(self, lift_lag: float) -> Floats:
        """Standard deviation (m,) of measured minus modelled rate: its own noise, and that of the restored lift."""
        return np.asarray(np.hypot(self._noise, noise_gain(lift_lag / self._interval) * self._by_lift), np.float64)


def _without_gain_error(measured: Floats, modelled: Floats, sigma: Floats) -> Floats:
    """Normalised residuals (n + 1,) of measured values (n,) without the gain error, which is appended in sigmas."""
    residual, scale = (measured - modelled) / sigma, modelled / sigma
    gain = float(scale @ residual) / (float(scale @ scale) + GAIN_ERROR**-2)
    return np.append(residual - gain * scale, gain / GAIN_ERROR)
