"""A model run through a recording: with the measurement up to an opening, open loop from the opening on."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.documents import key, unit
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.likelihood import windows
from observer_rt.identification.likelihood.events import JudgedEvent
from observer_rt.identification.likelihood.measured_rate import as_by_meter, rate_as_recorded
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.rows import Rows, in_mass_window
from observer_rt.identification.likelihood.true_inputs import TrueInputs
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.stability import in_stable_cells, substeps_needed

MOST_RUNS = 16  # runs of a recording: most models are asked for more than once
SPARE_SUBSTEPS = 1  # so that a little wear does not change their number


@dataclass(frozen=True, eq=False)
class SimulatedInjection:
    """A model on one event: n samples from the opening to the end of the ringing, SI."""

    event: JudgedEvent
    samples: NDArray[np.int64]  # (n,) of the recording, that the line pressure belongs to
    line_pressure: NDArray[np.float64]
    rate_samples: NDArray[np.int64]  # (n,) of the recording, that the rate belongs to
    rate: NDArray[np.float64]
    shown_rate: NDArray[np.float64]  # as its meter shows it


@dataclass(frozen=True)
class Consequence:
    """By how much a model moves: root mean square of the line pressure from opening to the end of the ringing [Pa],
    and mean of the injected mass [kg], over all events."""

    line_pressure: Annotated[float, key("line_pressure_rms_MPa"), unit(MEGAPASCAL)]
    mass: Annotated[float, key("injected_mass_mean_mg"), unit(MILLIGRAM)]


NO_CONSEQUENCE = Consequence(0.0, 0.0)
_Runs = list[tuple[EffectiveModel, tuple[SimulatedInjection, ...]]]
_RUNS: WeakKeyDictionary[Measurement, _Runs] = WeakKeyDictionary()


def simulated(measurement: Measurement, model: EffectiveModel) -> tuple[SimulatedInjection, ...]:
    """Line pressure as it would be recorded, and injection rate, of every event of a recording.

    The state follows the measurement by x~ up to the opening and runs open loop from there. The last runs are kept.
    """
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
    sample_rate = measurement.recording.sample_rate
    substeps = substeps_needed(model.injector, sample_rate, model.departures) + SPARE_SUBSTEPS
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


def pressure_gap(measurement: Measurement, injection: SimulatedInjection) -> NDArray[np.float64]:
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
    squares = np.concatenate(pressures) ** 2
    return Consequence(float(np.sqrt(np.mean(squares))), float(np.mean(masses)))


def measured_mass(measurement: Measurement, injection: SimulatedInjection, density: float) -> float:
    """Mass of an event by the measured rate [kg], nan without one; the meter's delay is corrected by the model."""
    measured = measurement.recording.injection_rate
    if measured is None:
        return math.nan
    inside = in_mass_window(measurement, injection.event, injection.rate_samples)
    late = (injection.rate - injection.shown_rate)[inside]
    return float(np.trapezoid(measured[injection.rate_samples[inside]] + late)) * measurement.interval * density
