"""The observer's constants for an injector of a bench: parameters, sample rate, temperature of the fuel."""

from observer_rt.config.bench import BenchInjector
from observer_rt.config.channels import effects_after_alignment
from observer_rt.config.injector import Meaning
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.engine.stream.state import Constants
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLISECOND
from observer_rt.model.accuracy import StatedAccuracy
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import (
    HIGHEST_TEMPERATURE,
    LOWEST_TEMPERATURE,
    InjectorParameters,
    at_temperature,
)
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate, refuse_unstable_cells

EVENTS_REQUIRED = 2  # judged, before a sample is valid
EVENTS_REQUIRED_RESTORED = 1  # the same with a restored state


def configured_noise(fitted: BenchInjector) -> NoiseLevels:
    """Noise levels of the bench file, SI."""
    noise = fitted.config.noise
    return NoiseLevels(
        rail_pressure=noise.rail_pressure_MPa * MEGAPASCAL,
        line_pressure=noise.line_pressure_MPa * MEGAPASCAL,
        needle_lift=noise.needle_lift_um * MICROMETRE,
    )


def bench_constants(
    fitted: BenchInjector, restored: bool = False, fuel_temperature: float | None = None
) -> Constants:
    """Constants of the observer for an injector, with fuel at a temperature [K] or, None, as in its file.

    Raises `UserError` when its sample rate is too low to integrate, or its file does not say how the fuel changes
    with a temperature that the bench measures.
    """
    constants = _constants(fitted, injector_at(fitted, fuel_temperature), restored)
    _require_integrable(fitted, fitted.parameters, constants)
    if fitted.config.signals.fuel_temperature is not None and fuel_temperature is None:
        injector_at(fitted, HIGHEST_TEMPERATURE)
        stiffest = injector_at(fitted, LOWEST_TEMPERATURE)
        _require_integrable(fitted, stiffest, _constants(fitted, stiffest, restored))
    return constants


def injector_at(fitted: BenchInjector, fuel_temperature: float | None) -> InjectorParameters:
    """The injector with fuel at a temperature [K]; None: as in its file.

    Raises `UserError` when the file does not say how the fuel changes.
    """
    if fuel_temperature is None:
        return fitted.parameters
    try:
        return at_temperature(fitted.parameters, fuel_temperature)
    except UserError as error:
        raise UserError(f"{fitted.parameters_path}: {error.location}", error.problem, error.remedy) from None


def _constants(fitted: BenchInjector, injector: InjectorParameters, restored: bool) -> Constants:
    learning = fitted.config.learning
    durations = Durations(
        learning.event_gap_ms * MILLISECOND,
        learning.learning_delay_ms * MILLISECOND,
        fitted.config.sampling.bridge_ms * MILLISECOND,
    )
    events_required = EVENTS_REQUIRED_RESTORED if restored else EVENTS_REQUIRED
    rate = fitted.config.sampling.rate_hz
    means = fitted.config.sampling.meaning is Meaning.MEAN
    stated = effects_after_alignment(fitted.config.signals)
    calibration = calibration_of(fitted)
    return constants_for(
        injector, rate, durations, events_required, rail_every(fitted), means, stated, calibration
    )


def calibration_of(fitted: BenchInjector) -> StatedAccuracy:
    """How well level and pressure sensors are known, as bench and injector file state it."""
    signals = fitted.config.signals
    line, rail = signals.line_pressure.accuracy_percent, signals.rail_pressure.accuracy_percent
    return StatedAccuracy.of(line, rail, fitted.parameters.accuracy)


def rail_every(fitted: BenchInjector) -> float:
    """Samples to one of the rail pressure."""
    rate = fitted.config.sampling.rate_hz
    return rate / (fitted.config.signals.rail_pressure.rate_hz or rate)


def _require_integrable(fitted: BenchInjector, injector: InjectorParameters, constants: Constants) -> None:
    substeps = constants.substeps
    rate = fitted.config.sampling.rate_hz
    refuse_unstable_cells(str(fitted.parameters_path), injector, constants.coefficients, constants.interval)
    if substeps <= MAX_SUBSTEPS or constants.coefficients.line.resolved > 0.0:
        return
    model = effective_model(injector)
    fastest = fastest_rate(model.injector, model.departures)
    raise UserError(
        fitted.location("sampling.rate_hz"),
        f"{rate:g} Hz would need {substeps} integration steps a sample (at most {MAX_SUBSTEPS}), "
        f"for the sac of {fitted.parameters_path.name} relaxes at up to {fastest:.3g} 1/s",
        f"sample at {rate * substeps / MAX_SUBSTEPS:.0f} Hz or more, or give line.model = 'wave', beside which a sac "
        "of any volume will do",
    )
