"""Findings about the observer of one injector: its integration, fuel, fitted model, level and reach."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import effects_after_alignment
from observer_rt.core.stream.stream import MAX_EVENT, dead_band
from observer_rt.desk.check.findings import Finding, Statement, graded, ruled, warning
from observer_rt.desk.simulation.schedule import REFERENCE_PRESSURE, make_schedule
from observer_rt.desk.simulation.simulate import simulate
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.engine.service.injector import bench_constants, calibration_of, doubt_about_fit
from observer_rt.engine.service.noise import configured_noise
from observer_rt.engine.stream.state import noise_gain
from observer_rt.foundation.units import MICROMETRE, MICROSECOND, MILLISECOND, Z_95, ZERO_CELSIUS
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate
from observer_rt.model.surroundings import at_temperature
from observer_rt.model.wave_line import WaveLine

SHOWN_TEMPERATURES = 20.0, 40.0, 80.0  # degC
SAMPLES_PER_PERIOD = 10  # of the line's own oscillation, below which it is not seen well
SHORT = 0.6 * MILLISECOND  # s, energizing of an injection whose mass is looked for
WIDER = 0.01  # share by which a nozzle is wider that is compared
SHOWN = 0.03  # of a mass: 95 % interval that line pressure should show
LARGEST_DEAD_BAND = 0.1  # of the full lift
MEASURED_PERCENT = 0.2  # of a mass, one sigma: a good injection meter
_LEVEL_SOURCES = {
    "file": "absolute level by A_L/(rho_L L_L) of the file, not measured",
    "measured_rate": "absolute level by the measured rate",
    "measured_mass": "absolute level by measured masses",
}


def observer_findings(injector: BenchInjector) -> list[Finding]:
    """All findings about the observer of an injector; fewer where its integration is not stable."""
    integration = _integration(injector)
    is_stable = integration[0].error is None
    is_wave_line = isinstance(injector.coefficients.line, WaveLine)  # of unstable cells the error says enough
    fuel = _fuel(injector) if is_stable else []
    limits = _limits(injector) if is_stable or not is_wave_line else []
    return [*integration, *fuel, *_fitted_model(injector), *_level(injector), *limits]


@ruled("fuel")
def _fuel(injector: BenchInjector) -> Iterator[Statement]:
    """Density and bulk modulus of the fuel over its temperature, where a bench measures that."""
    if injector.config.signals.fuel_temperature is None:
        return
    fluids = {at: at_temperature(injector.parameters, at + ZERO_CELSIUS).fluid for at in SHOWN_TEMPERATURES}
    yield "; ".join(
        f"{celsius:.0f} degC: {fluid.density_nozzle:.0f} kg/m3, {fluid.bulk_modulus_line / 1e9:.2f} GPa"
        for celsius, fluid in fluids.items()
    )


@ruled("integration")
def _integration(injector: BenchInjector) -> Iterator[Statement]:
    steps = bench_constants(injector).substeps
    model, rate = effective_model(injector.parameters), injector.sample_rate
    if stepping := model.coefficients.line.stepping(1.0 / rate):
        yield f"{steps} steps a sample at {rate:g} Hz; {stepping}"
        return
    fastest = fastest_rate(model.injector, model.coefficients)
    yield f"{steps} steps a sample (at most {MAX_SUBSTEPS}) at {rate:g} Hz, for a fastest rate of {fastest:.3g} 1/s"


@ruled("fitted model")
def _fitted_model(injector: BenchInjector) -> Iterator[Statement]:
    baseline = injector.parameters.baseline
    if baseline is None:
        return
    doubt = doubt_about_fit(injector)
    if doubt is not None:
        yield warning(doubt.text, doubt.remedy)
        return
    yield (
        f"{injector.parameters_path.name}: adequate, by {baseline.injections} healthy injections at "
        f"{baseline.sample_rate_Hz:g} Hz; {_LEVEL_SOURCES[baseline.level]}"
    )


@ruled("level")
def _level(injector: BenchInjector) -> Iterator[Statement]:
    """How well the level of all masses is known, and what would make it better known."""
    calibration = calibration_of(injector)
    if calibration.is_calibrated:
        if text := calibration.as_text():
            yield text
        return
    bore, length = 100.0 * calibration.line_diameter, 100.0 * calibration.line_length
    measured = replace(calibration, measured=0.01 * MEASURED_PERCENT)
    yield warning(
        f"{calibration.as_text()}: by the line's bore (known to {bore:g} %) and length ({length:g} %), the pressure "
        f"sensors ({100.0 * calibration.line_sensor:g} and {100.0 * calibration.rail_sensor:g} %) and flow beside "
        "the nozzle",
        f"one measured mass known to {MEASURED_PERCENT:g} % makes it ±{measured.bound_pct:.1f} %: "
        "`observer-rt fit --mass`",
    )


@ruled("mass")
def mass_findings(injector: BenchInjector) -> Iterator[Statement]:
    """How well the line pressure of an injection tells its mass, by what a wider nozzle changes of it over noise."""
    schedule = make_schedule([REFERENCE_PRESSURE], 1, 30 * MILLISECOND, [SHORT])
    rate, wider = injector.sample_rate, sized("orifice_area", v_H=WIDER)
    stated, changed = (simulate(injector.parameters, schedule, rate, effects).truth for effects in ((), (wider,)))
    slope = (changed.line_pressure - stated.line_pressure) / (WIDER * configured_noise(injector).line_pressure)
    if not slope.any():
        return
    mass = stated.injection_rate.sum() / rate * injector.coefficients.density
    share = Z_95 / float(np.linalg.norm(slope))
    text = f"one injection of {mass / 1e-6:.2g} mg at 100 MPa shows its mass to ±{share:.1%} at best (95 %)"
    yield graded(share < SHOWN, text, "a quieter line-pressure sensor, or one nearer to the injector, shows more")


def _limits(injector: BenchInjector) -> list[Finding]:
    """Limits of what the observer sees: line mode, dead band, look-ahead and events."""
    rate = injector.sample_rate
    stated = effects_after_alignment(injector.config.signals)
    constants = constants_for(injector.parameters, rate, Durations(), events_required=0, stated=stated)
    lookahead = constants.timing.lookahead + constants.undoing.ahead
    line_mode = constants.coefficients.line.mode / (2 * math.pi)
    opens, shuts = dead_band(configured_noise(injector).needle_lift * noise_gain(constants.undoing.lift_lag))
    gap, delay = injector.config.learning.event_gap_ms, injector.config.learning.learning_delay_ms
    longest = MAX_EVENT / rate / MILLISECOND
    return [
        graded(
            rate >= SAMPLES_PER_PERIOD * line_mode,
            f"{line_mode:.0f} Hz, {rate / line_mode:.3g} samples a period",
            f"sample at {SAMPLES_PER_PERIOD * line_mode:.0f} Hz or more, for {SAMPLES_PER_PERIOD} a period",
            "line mode",
        ),
        graded(
            opens <= LARGEST_DEAD_BAND * injector.parameters.seat.max_lift,
            f"opens above {opens / MICROMETRE:.3g} um of lift, shuts below {shuts / MICROMETRE:.3g} um",
            f"above {LARGEST_DEAD_BAND:.0%} of the full lift short injections are missed: "
            "lower the noise of the needle lift",
            "dead band",
        ),
        graded(True, f"{lookahead} samples, {lookahead / rate / MICROSECOND:.4g} us", topic="look-ahead"),
        graded(
            longest >= 2 * gap,
            f"openings within {gap:g} ms are one event; a new correction takes force {gap + delay:g} ms after the "
            f"needle shuts; learned from events up to {longest:.0f} ms, gap included",
            "shorten learning.event_gap_ms or sample slower",
            "events",
        ),
    ]
