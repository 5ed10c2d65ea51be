"""An injector of a bench as the service runs it: constants, learner, doubts about its fit, its model open loop."""

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.config.injector import Meaning
from observer_rt.config.signals import OPTIONAL_SIGNALS, Role, effects_after_alignment
from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import Terms
from observer_rt.core.stream.stream import OFFSET_FOLLOWS
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.predictor import NO_COMMANDS, NO_SLOPES, Setting, Window
from observer_rt.engine.estimation.scalars import nothing_learned
from observer_rt.engine.learning.healthy import Healthy, healthy_of, is_same_rate, with_remainder
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Constants, Doubt, Observer
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLISECOND
from observer_rt.model.accuracy import StatedAccuracy
from observer_rt.model.effective import NO_CLOCK, Clock, Coefficients
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate, refuse_unstable_cells
from observer_rt.model.surroundings import Surroundings, in_surroundings
from observer_rt.model.terms.variable import Variable

if TYPE_CHECKING:
    from observer_rt.engine.estimation.signal_noise import SlowNoise

EVENTS_REQUIRED = 2  # judged, before a sample is valid
EVENTS_REQUIRED_RESTORED = 1  # the same with a restored state

LearnerFactory = Callable[[BenchInjector, Constants, Knowledge], Learner]
"""Factory of a `Core`'s learner: `make_learner`, or another where learners are compared."""

SIGNALS = {  # short name, unit, its size
    Role.RAIL_PRESSURE: ("rail", "MPa", MEGAPASCAL),
    Role.LINE_PRESSURE: ("line", "MPa", MEGAPASCAL),
    Role.NEEDLE_LIFT: ("lift", "um", MICROMETRE),
}


def configured_noise(injector: BenchInjector) -> NoiseLevels:
    """Noise levels of the bench file, SI."""
    noise = injector.config.noise
    return NoiseLevels(
        rail_pressure=noise.rail_pressure_MPa * MEGAPASCAL,
        line_pressure=noise.line_pressure_MPa * MEGAPASCAL,
        needle_lift=noise.needle_lift_um * MICROMETRE,
    )


def bench_constants(
    injector: BenchInjector, restored: bool = False, surroundings: Surroundings | None = None
) -> Constants:
    """Constants of the observer for an injector in surroundings; None: in those of its file, before any is measured.

    Raises `UserError` when its sample rate is too low to integrate, or its file does not say how the fuel changes
    with a temperature that the bench measures.
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
    rate = injector.config.sampling.rate_hz
    means = injector.config.sampling.meaning is Meaning.MEAN
    stated = effects_after_alignment(injector.config.signals)
    calibration = calibration_of(injector)
    every = rail_every(injector)
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
    rate = injector.config.sampling.rate_hz
    return rate / (injector.config.signals.rail_pressure.rate_hz or rate)


def _require_integrable(injector: BenchInjector, parameters: InjectorParameters, constants: Constants) -> None:
    substeps = constants.substeps
    rate = injector.config.sampling.rate_hz
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
    """The learner of an injector."""
    return Learner(constants, knowledge, healthy=healthy_injector(injector))


def healthy_injector(injector: BenchInjector) -> Healthy:
    """Residuals of the healthy injector under its fitted model, and under terms that were accepted in part."""
    config, rate = injector.config, injector.config.sampling.rate_hz
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
    baseline, rate = injector.parameters.baseline, injector.config.sampling.rate_hz
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


def slow_noise_of(observer: Observer, rows: NDArray[np.void], white: NoiseLevels) -> "Mapping[Role, SlowNoise]":
    """Slow noise of line pressure [Pa] and needle lift [m] in processed samples `rows` (n,).

    For the line, innovations are used: slow changes of the rail pressure, which the line follows, are no noise.
    """
    from observer_rt.engine.estimation.signal_noise import slow_noise  # only for who looks at a daemon, or at a log

    c, rate = observer.constants.coefficients, 1.0 / observer.constants.interval
    resting = rows[rows["resting"] & ~rows["interpolated"] & (rows["doubt"] == Doubt.NONE)]
    index = resting["index"].astype(np.int64)
    sigma = float(observer.memory[0]["innovation_noise"]["sigma"]) * c.pressure_scale
    line = slow_noise(resting["innovation"] * c.pressure_scale, index, rate, sigma)
    lift = slow_noise(resting["needle_lift"], index, rate, white.needle_lift)
    levels = {}
    if line is not None:
        passed = 1.0 if line.frequency is None else _passed(observer, line.frequency)
        levels[Role.LINE_PRESSURE] = replace(line, strength=line.strength / passed)
    if lift is not None:
        levels[Role.NEEDLE_LIFT] = lift
    return levels


def _passed(observer: Observer, frequency: float) -> float:
    """Gain from a disturbance of the line sensor to the innovations at a frequency [Hz]: x~ follows the rest."""
    line, _ = observer.constants.coefficients.line.transition(observer.constants.interval)
    gain = observer.gains[-1][[0, 1, *range(3, 1 + len(line))]]
    moved = line * cmath.exp(-2j * math.pi * frequency * observer.constants.interval)
    followed = moved @ np.linalg.solve(np.eye(len(line)) - moved, gain.astype(np.complex128))
    passed = 1.0 / (1.0 + followed[0])
    if observer.memory[0]["judgement"]["offset_moves"]:
        turns = 2j * math.pi * frequency * OFFSET_FOLLOWS
        passed *= turns / (1.0 + turns)
    return float(abs(passed))


def noise_text(white: NoiseLevels, slow: "Mapping[Role, SlowNoise]") -> str:
    """Sentence with the noise levels of all signals, and their slow parts."""
    noises = []
    for role, (name, unit, size) in SIGNALS.items():
        text = f"{name} {getattr(white, role.value) / size:.2g} {unit}"
        noises.append(f"{text} and {slow[role].as_text(unit, size)}" if role in slow else text)
    return ", ".join(noises)


class Follower:
    """x^ without correction, from a state on; the measured line pressure does not matter."""

    def __init__(self, constants: Constants) -> None:
        self.constants = constants
        """Constants in force from the next block on."""
        self.begin(np.full(constants.coefficients.states, np.nan))

    def begin(self, x: NDArray[np.float64], clock: Clock = NO_CLOCK) -> None:
        """Be in a state x (states,) at a sample, at which the clock of the terms shows this."""
        self._x, self._terms = x, Terms(self.constants.program, *clock)

    def along(self, rows: NDArray[np.void], commands: NDArray[np.float64] = NO_COMMANDS) -> NDArray[np.float64]:
        """Injection rate (n,) [m3/s] at samples (n,); the state belongs to the first, where the rate is 0.

        rows: dtype `SAMPLE` or `sample_dtype`; commands (k, 2): as of `Window`.
        """
        constants, c = self.constants, self.constants.coefficients
        errors, rate = np.empty((2, len(rows)))
        setting = Setting(constants.interval, constants.substeps, c, np.zeros(c.states), program=constants.program)
        window = Window(
            inputs=np.column_stack([rows["rail_pressure"], rows["seat_area"]]),
            output=np.zeros(len(rows)),
            resting=rows["resting"].copy(),
            start=np.append(self._x, self._x[0]),
            opening=0,
            knots=np.column_stack([rows["lift_after"], rows["lift_area"]]),
            commands=commands,
        )
        self._x = follow(window, setting, nothing_learned(c), 0, errors, rate, None, NO_SLOPES, self._terms)
        return rate


@dataclass(frozen=True)
class ComparedRate:
    """Reference of an injection: its rate [m3/s] over the injection's samples, and its mass [kg]."""

    name: str
    rate: NDArray[np.float64]
    mass: float


References = Callable[[InjectionReport, NDArray[np.void]], Sequence[ComparedRate]]
"""References for an injection and its samples, dtype `stream.state.sample_dtype`."""


class NominalInjection:
    """The model as given, run over an injection's own inputs."""

    def __init__(self, injector: BenchInjector) -> None:
        self._constants = bench_constants(injector)
        self.coefficients: Coefficients = self._constants.coefficients

    def __call__(self, report: InjectionReport, rows: NDArray[np.void]) -> Sequence[ComparedRate]:
        """Rate and mass of the injection; none where the needle was open from the start."""
        is_open = rows["seat_area"] > 0.0
        if not is_open.any() or is_open[0]:
            return ()
        follower = Follower(self._constants)
        follower.begin(rows["x_tilde"][0])
        rate = follower.along(rows)
        mass = float(np.trapezoid(rate)) * self._constants.interval * report.density
        return [ComparedRate("nominal", rate, mass)]
