"""Findings about an injector's observer: integration, gain, dead band, look-ahead, events, training."""

import math
from collections.abc import Iterator

from observer_rt.check.findings import Finding, Said, graded, ruled
from observer_rt.check.mapping import fuel_findings
from observer_rt.config.bench import BenchInjector
from observer_rt.config.channels import effects_after_alignment
from observer_rt.estimation.gain import gain_schedule
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MILLISECOND
from observer_rt.model.effects import effective_model
from observer_rt.model.line.interface import own_step
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.observer.observer import Durations, constants_for
from observer_rt.observer.paper_scheme.systems import doubts_about_gain
from observer_rt.observer.stream.front_end import dead_band, noise_gain
from observer_rt.observer.stream.state import MAX_EVENT
from observer_rt.service.compiled.constants import bench_constants, configured_noise, rail_every
from observer_rt.service.core.learners import doubt_about_fit, make_learner

SAMPLES_PER_PERIOD = 10  # of the line's own oscillation, below which it is not seen well
LARGEST_DEAD_BAND = 0.1  # of the full lift
_LEVEL = {
    "file": "absolute level by A_L/(rho_L L_L) of the file, not measured",
    "measured_rate": "absolute level by the measured rate",
    "measured_mass": "absolute level by measured masses",
}


def observer_findings(fitted: BenchInjector) -> list[Finding]:
    """All findings about the observer of an injector; there is none with too many cells to be stable."""
    integration = _integration(fitted)
    is_stable = integration[0].error is None
    fuel = fuel_findings(fitted) if is_stable else []
    steps_itself = own_step(type(effective_model(fitted.parameters).coefficients.line)) is not None
    observer = _observer(fitted) if is_stable or not steps_itself else []
    return [*integration, *fuel, *_fitted_model(fitted), *observer]


@ruled("integration")
def _integration(fitted: BenchInjector) -> Iterator[Said]:
    """How a sample is integrated, and how near the limits that is."""
    substeps = bench_constants(fitted).substeps
    model, rate = effective_model(fitted.parameters), fitted.config.sampling.rate_hz
    if stepping := model.coefficients.line.stepping(1.0 / rate):
        yield f"{substeps} steps a sample at {rate:g} Hz; {stepping}"
        return
    fastest = fastest_rate(model.injector, model.departures)
    yield (
        f"{substeps} steps a sample (at most {MAX_SUBSTEPS}) at {rate:g} Hz, for a fastest rate of {fastest:.3g} 1/s"
    )


@ruled("fitted model")
def _fitted_model(fitted: BenchInjector) -> Iterator[Said]:
    """What the injector's file remembers of being fitted; nothing where it was not."""
    baseline = fitted.parameters.baseline
    if baseline is None:
        return
    doubt = doubt_about_fit(fitted)
    if doubt is not None:
        yield False, doubt.text, doubt.remedy
        return
    yield (
        f"{fitted.parameters_path.name}: adequate, by {baseline.injections} healthy injections at "
        f"{baseline.sample_rate_Hz:g} Hz; {_LEVEL[baseline.level]}"
    )


def _observer(fitted: BenchInjector) -> list[Finding]:
    rate = fitted.config.sampling.rate_hz
    noise = configured_noise(fitted)
    stated = effects_after_alignment(fitted.config.signals)
    constants = constants_for(fitted.parameters, rate, Durations(), events_required=0, stated=stated)
    sensor, lookahead = constants.sensor, constants.timing.lookahead + constants.undoing.ahead
    every = rail_every(fitted)
    schedule = gain_schedule(constants.coefficients, noise, rate, sensor.lag, sensor.fraction, every)
    c = constants.coefficients
    line_mode = c.line.mode / (2 * math.pi)
    opens, shuts = dead_band(noise.needle_lift * noise_gain(constants.undoing.lift_lag))
    return [
        graded(
            "line mode",
            rate >= SAMPLES_PER_PERIOD * line_mode,
            f"{line_mode:.0f} Hz, {rate / line_mode:.3g} samples a period",
            f"sample at {SAMPLES_PER_PERIOD * line_mode:.0f} Hz or more, for {SAMPLES_PER_PERIOD} a period",
        ),
        graded(
            "gain",
            True,
            f"steady gain {schedule.gains[-1, 0]:.3g} on p_L and {schedule.gains[-1, 1]:.3g} on Q_L (normalised); "
            f"innovation sigma {schedule.innovation_sigma * c.pressure_scale / MEGAPASCAL:.3g} MPa",
        ),
        graded(
            "dead band",
            opens <= LARGEST_DEAD_BAND * fitted.parameters.seat.max_lift,
            f"opens above {opens / MICROMETRE:.3g} um of lift, shuts below {shuts / MICROMETRE:.3g} um",
            f"above {LARGEST_DEAD_BAND:.0%} of the full lift short injections are missed: "
            "lower the noise of the needle lift",
        ),
        graded("look-ahead", True, f"{lookahead} samples, {lookahead / rate / MICROSECOND:.4g} us"),
        *_event_timing(fitted),
        *_paper_training(fitted),
    ]


@ruled("events")
def _event_timing(fitted: BenchInjector) -> Iterator[Said]:
    learning = fitted.config.learning
    longest = MAX_EVENT / fitted.config.sampling.rate_hz / MILLISECOND
    text = (
        f"openings within {learning.event_gap_ms:g} ms are one event; a new correction takes force "
        f"{learning.event_gap_ms + learning.learning_delay_ms:g} ms after the needle shuts; learned from events "
        f"up to {longest:.0f} ms, gap included"
    )
    yield longest >= 2 * learning.event_gap_ms, text, "shorten learning.event_gap_ms or sample slower"


@ruled("training")
def _paper_training(fitted: BenchInjector) -> Iterator[Said]:
    """What is to be said of `training = "paper"`, nothing where it is not used."""
    gain = fitted.config.learning.identification_gain
    if gain is None:
        return
    c, noise = effective_model(fitted.parameters).coefficients, configured_noise(fitted)
    make_learner(fitted, bench_constants(fitted), no_knowledge(noise, c.pressure_scale))
    yield False, "paper: for comparison only, its results never count as valid", ""
    doubts = doubts_about_gain(gain, c, noise)
    yield graded("identification gain", doubts is None, f"{gain:g} 1/s", doubts or "")
