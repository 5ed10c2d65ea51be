"""An injector of a bench as the service runs it: constants of its observer, its learner, doubts about its fit."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import NamedTuple

from observer_rt.config.bench import BenchInjector
from observer_rt.config.injector_sections import Meaning
from observer_rt.config.signals import OPTIONAL_SIGNALS, effects_after_alignment
from observer_rt.engine.learning.healthy import Healthy, healthy_of, is_same_rate, with_remainder
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.engine.stream.state import Constants
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.model.accuracy import StatedAccuracy
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate, refuse_unstable_cells
from observer_rt.model.surroundings import Surroundings, in_surroundings
from observer_rt.model.terms.variable import Variable

EVENTS_REQUIRED = 2  # judged, before a sample is valid
EVENTS_REQUIRED_RESTORED = 1  # the same with a restored state

LearnerFactory = Callable[[BenchInjector, Constants, Knowledge], Learner]
"""Factory of a `Core`'s learner: `make_learner`, or another where learners are compared."""


def bench_constants(
    injector: BenchInjector, restored: bool = False, surroundings: Surroundings | None = None
) -> Constants:
    """Constants for an injector in surroundings, None: in those of its file, before any is measured.

    Raises `UserError` for a sample rate too low to integrate, or a measured temperature without its effect on fuel.
    """
    if surroundings is None and (roles := injector.config.signals.surroundings):
        for extremes in product(*(OPTIONAL_SIGNALS[role].possible for role in roles)):
            _constants(injector, Surroundings(**dict(zip(roles, extremes, strict=True))), restored)
    return _constants(injector, surroundings or Surroundings(), restored)


def _constants(injector: BenchInjector, surroundings: Surroundings, restored: bool) -> Constants:
    try:
        parameters = in_surroundings(injector.parameters, surroundings)
    except UserError as error:
        raise UserError(f"{injector.parameters_path}: {error.location}", error.problem, error.remedy) from None
    learning = injector.config.learning
    durations = Durations(
        learning.event_gap_ms * MILLISECOND,
        learning.learning_delay_ms * MILLISECOND,
        injector.config.sampling.bridge_ms * MILLISECOND,
    )
    events_required = EVENTS_REQUIRED_RESTORED if restored else EVENTS_REQUIRED
    means = injector.config.sampling.meaning is Meaning.MEAN
    stated = effects_after_alignment(injector.config.signals)
    calibration = calibration_of(injector)
    every, rate = rail_every(injector), injector.sample_rate
    constants = constants_for(parameters, rate, durations, events_required, every, means, stated, calibration)
    _require_integrable(injector, parameters, constants)
    needle = None if injector.has_lift else effective_model(parameters).injector.needle_law
    return constants._replace(needle=needle, surroundings=surroundings)


def calibration_of(injector: BenchInjector) -> StatedAccuracy:
    """How well level and pressure sensors are known, as bench and injector file state it."""
    signals = injector.config.signals
    line, rail = signals.line_pressure.accuracy_percent, signals.rail_pressure.accuracy_percent
    return StatedAccuracy.of(line, rail, injector.parameters.accuracy)


def rail_every(injector: BenchInjector) -> float:
    """Samples to one of the rail pressure."""
    return injector.sample_rate / (injector.config.signals.rail_pressure.rate_hz or injector.sample_rate)


def _require_integrable(injector: BenchInjector, parameters: InjectorParameters, constants: Constants) -> None:
    substeps, rate = constants.substeps, injector.sample_rate
    refuse_unstable_cells(str(injector.parameters_path), parameters, constants.coefficients, constants.interval)
    if substeps <= MAX_SUBSTEPS or constants.coefficients.line.resolved > 0.0:
        return
    model = effective_model(parameters)
    fastest = fastest_rate(model.injector, model.coefficients)
    raise UserError(
        injector.location("sampling.rate_hz"),
        f"{rate:g} Hz would need {substeps} integration steps a sample (at most {MAX_SUBSTEPS}), "
        f"for the sac of {injector.parameters_path.name} relaxes at up to {fastest:.3g} 1/s",
        f"sample at {rate * substeps / MAX_SUBSTEPS:.0f} Hz or more, or give line.model = 'wave', beside which a sac "
        "of any volume will do",
    )


def make_learner(injector: BenchInjector, constants: Constants, knowledge: Knowledge) -> Learner:
    return Learner(constants, knowledge, healthy=healthy_injector(injector))


def healthy_injector(injector: BenchInjector) -> Healthy:
    """Residuals of the healthy injector under its fitted model, and under terms that were accepted in part."""
    config, rate = injector.config, injector.sample_rate
    healthy = healthy_of(injector.parameters.baseline, rate, config.learning.on_inadequate_model)
    ranges = [term.range_seen.get(Variable.LINE_PRESSURE) for term in injector.parameters.terms]
    lows, highs = zip((-math.inf, math.inf), *(one for one in ranges if one is not None), strict=True)
    seen = MEGAPASCAL * max(lows), MEGAPASCAL * min(highs)
    return with_remainder(replace(healthy, seen=seen), injector.parameters.remainder, rate)


class FitDoubt(NamedTuple):
    """Objection to a fitted model, and what to do."""

    text: str
    remedy: str


def doubt_about_fit(injector: BenchInjector) -> FitDoubt | None:
    """Objection to an injector's fitted model on this bench; None without an objection, or without a fit."""
    baseline, rate = injector.parameters.baseline, injector.sample_rate
    name = injector.parameters_path.name
    if baseline is None:
        return None
    if not baseline.adequate:
        so = (
            "it is learned with all the same, as learning.on_inadequate_model says"
            if injector.config.learning.on_inadequate_model
            else "nothing is learned, and no injection is valid (MODEL_INADEQUATE)"
        )
        return FitDoubt(
            f"{name} was found inadequate by its own fit: {so}",
            "see what `observer-rt fit` says to try, and docs/own-injector.md",
        )
    if not is_same_rate(baseline.sample_rate_Hz, rate):
        return FitDoubt(
            f"{name} was fitted at {baseline.sample_rate_Hz:g} Hz and is not comparable at {rate:g} Hz: what its fit "
            "left unexplained is not allowed for",
            f"fit it to recordings at {rate:g} Hz",
        )
    return None
