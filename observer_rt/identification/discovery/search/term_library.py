"""The library of terms that `discover` tries where the vocabulary does not explain recordings.

A law is of order 1 where an injector works, so that its coefficient is in the unit of its equation. Pressures are
centred: with a factor of the pressure itself, most of it would be a constant.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.identification.discovery.search.adequacy import VARIANCE_LIMIT, healthy_level, worst
from observer_rt.identification.discovery.search.curves import (
    CURVES,
    FreeCurve,
    free_curves,
    made_to_measure,
)
from observer_rt.identification.discovery.search.hypothesis import Hypothesis, Sizing
from observer_rt.identification.discovery.search.tables import tables
from observer_rt.identification.discovery.search.term_fit import Each, TermFit
from observer_rt.identification.discovery.search.waves import lines, waves
from observer_rt.identification.likelihood.bounded_fit import Range, Residuals, fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood, Pool, pool_of
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.term_effect import (
    LAWS_OF_EFFECTS,
    FormNumber,
    TermLaw,
    form_freed,
    form_settled,
    is_term,
    term_effect,
)
from observer_rt.model.terms.term import TermEquation

WITHIN = 4.0  # times what it is scored with, that a number within a law may become
MOST_BREAKS = 5  # injections after each of which something may be new
REMAINDER = 0.06  # of what there was, that a fitted model may leave: a law is no more exact than it is
EXACT = 1e-3  # of the same, that an exact model may leave: steps and samples are not finer
TAILORED_FURTHER = 2  # most promising equations, in which laws of further terms are made to measure
ITERATIONS = 8  # of a fit with the numbers within laws free
STEP = 0.01  # of the bound: a term so small changes the innovations in proportion

_SHORT = {  # T and N: time and injection number, from 0 to 1 over the recordings
    "Q": "(line_flow/60)",
    "P": "((line_pressure - 100)/50)",
    "R": "((rail_pressure - 100)/50)",
    "X": "(needle_lift/max_lift)",
    "V": "lift_rate",
    "U": "(time_since_opening/1)",
    "H": "((sac_pressure - chamber_pressure)/100)",
    "S": "((line_pressure - sac_pressure)/10)",
    "D": "((line_pressure - chamber_pressure)/100)",
}
SHAPED: Mapping[str, tuple[float, ...]] = {
    "ringing(line_pressure/1, A, W)": (5.0, 6.2, 7.6, 9.4),
    "X - lagged(X, A)": (0.02, 0.05, 0.1, 0.2),
    "Q - lagged(Q, A)": (0.02, 0.05, 0.1, 0.3),
    "P - lagged(P, A)": (0.05, 0.2, 0.5),
    "R - lagged(R, A)": (0.05, 0.2, 0.8),
    "lagged(Q, A)": (0.1, 0.3, 1.0),
    "lagged(nozzle_flow/60, A)": (0.1, 0.5),
    "max(line_pressure/50 - A, 0)": (1.4, 1.8, 2.4),
    "max(A - line_pressure/50, 0)": (1.4, 1.8, 2.4),
    "abs(line_pressure/50 - A)": (1.4, 1.8, 2.4),
    "max(rail_pressure/50 - A, 0)": (1.4, 1.8, 2.4),
    "max(A - rail_pressure/50, 0)": (1.4, 1.8, 2.4),
    "abs(rail_pressure/50 - A)": (1.4, 1.8, 2.4),
    "line_pressure_rate/50 - lagged(line_pressure_rate/50, A)": (0.02,),
    "exp(-X/A)": (0.1, 0.3),
    "max(X - A, 0)": (0.5, 0.8),
    "exp(-U/A)": (0.3, 1.0),
    "sqrt(A/(H + A))": (0.01, 0.1),
    "R^2 - A": (0.5,),
    "P^2 - A": (0.5,),
    "Q*exp(-U/A)": (1.0,),
    "Q*abs(Q)*exp(-U/A)": (1.0,),
}
"""Laws with a number A of their own, fitted, too, where they lead, and what it is where it is scored."""
DAMPING = FormNumber(0.15, 0.02, 0.6)
"""The number W of a law that rings."""
_OF_SEAT = (
    "X", "X^2", "exp(-X/A)", "max(X - A, 0)", "X > 0.93",
    "V", "abs(V)", "opening", "closing", "U", "exp(-U/A)", "T", "N", "B", "R", "X - lagged(X, A)",
)  # fmt: skip
LIBRARY: Mapping[TermEquation, tuple[str, ...]] = {
    TermEquation.LINE_FLOW: (
        "Q", "sqrt(Q)", "Q^3", "Q^2", "line_pressure_rate/50", "V", "X", "Q*(Q < 0)", "Q*abs(Q)*(Q < 0)",
        "Q*T", "Q*N", "Q*P", "Q*exp(-U/A)", "Q*abs(Q)*T", "Q*abs(Q)*N", "Q*abs(Q)*P", "Q*abs(Q)*exp(-U/A)",
        "Q - lagged(Q, A)", "lagged(Q, A)",
    ),
    TermEquation.INERTANCE: ("1", "abs(Q)", "Q", "Q^2", "P", "P^2", "T", "N", "X", "U", "exp(-U/A)"),
    TermEquation.STIFFNESS: (
        "abs(Q)", "Q", "Q^2", "P", "P^2", "P - lagged(P, A)", "100/(line_pressure + 20)", "T", "N", "X", "U",
        "exp(-U/A)",
    ),
    TermEquation.RAIL_PRESSURE: (
        "R^2", "R^2 - A", "R^3", "T", "N", "X", "open", "abs(Q)", "rail_pressure_rate",
        "R - lagged(R, A)", "lagged(Q, A)", "max(rail_pressure/50 - A, 0)", "max(A - rail_pressure/50, 0)",
        "abs(rail_pressure/50 - A)",
    ),
    TermEquation.LINE_PRESSURE: (
        "1", "sqrt(D)", "D^2", "D^3", "D*closed", "sqrt(D)*closed", "D*open", "sqrt(D)*open", "X", "V", "abs(V)",
        "T", "N", "D*T", "D*N", "D*B", "X - lagged(X, A)", "P - lagged(P, A)",
    ),
    TermEquation.SEAT_FLOW: (*_OF_SEAT, "tanh(S)", "sqrt(tanh(S))"),
    TermEquation.NOZZLE_FLOW: (
        *_OF_SEAT, "H", "sqrt(H)", "H^2", "sqrt(A/(H + A))", "P", "abs(Q)",
    ),
    TermEquation.CHAMBER_PRESSURE: (
        "min(X/0.33, 1)", "X", "U", "exp(-U/A)", "nozzle_flow/60", "lagged(nozzle_flow/60, A)",
        "T", "N", "H",
    ),
    TermEquation.NEEDLE_LIFT: (
        "X^2", "X^3", "V", "open*T", "open*N", "open*B", "open*R", "X - lagged(X, A)", "closed",
    ),
    TermEquation.LINE_PRESSURE_SENSOR: (
        "P^2", "P^2 - A", "P^3", "abs(line_pressure_rate)/50", "line_pressure_rate/50", "T", "N", "X", "V", "R", "Q",
        "P - lagged(P, A)", "line_pressure_rate/50 - lagged(line_pressure_rate/50, A)",
        "ringing(line_pressure/1, A, W)", "max(line_pressure/50 - A, 0)", "max(A - line_pressure/50, 0)",
        "abs(line_pressure/50 - A)",
    ),
}  # fmt: skip
"""Laws by equation."""


@dataclass(frozen=True)
class RecordingSpan:
    """Largest time [s] and injection number of the recordings."""

    time: float
    injections: float


def library(span: RecordingSpan) -> Iterator[Effect]:
    """The terms of the library as effects with one size, their coefficient."""
    unnamed = [law for name, law in LAWS_OF_EFFECTS.items() if name not in VOCABULARY]
    for equation, laws in LIBRARY.items():
        for law in (*laws, *(one for other, one in unnamed if other is equation)):
            if "N" in law and law.replace("N", "B") in laws and span.injections <= 2.0:
                continue  # of two injections both are the same
            if not set(law) & {"N", "B"} or span.injections > 1.0:
                yield from (
                    term_effect(equation, *one) for one in product(spelled(law, span), numbers_of(law))
                )


def numbers_of(law: str) -> list[tuple[FormNumber, ...]]:
    """The numbers within a law of the library, where it is scored."""
    further = (DAMPING,) if "W" in law else ()
    shaped = (FormNumber(value, value / WITHIN, value * WITHIN) for value in SHAPED.get(law, ()))
    return [(value, *further) for value in shaped] or [()]


def spelled(law: str, span: RecordingSpan) -> Iterator[str]:
    """A law of the library in the words of laws: with B, one for every injection after which something may be new."""
    for number in range(1, min(int(span.injections), MOST_BREAKS + 1)) if "B" in law else (0,):
        letters = _SHORT | {
            "T": f"(time/{span.time:.3g})",
            "N": f"((injection_number - 1)/{max(span.injections - 1.0, 1.0):.3g})",
            "B": f"(injection_number > {number})",
        }
        yield "".join(letters.get(letter, letter) for letter in law)


class InjectorTerms:
    """An injector's recordings as a `TermProblem`: terms of a library, and effects of the vocabulary beside them."""

    def __init__(
        self,
        likelihood: JointLikelihood,
        nominal: EffectiveModel,
        effects: Sequence[Effect],
        baseline: Healthy,
    ) -> None:
        self._likelihood = likelihood
        self._nominal = nominal
        self._baseline = baseline
        self._before: Pool | None = None
        self._known_curves: dict[tuple[tuple[int, ...], tuple[TermEquation, ...]], Sequence[FreeCurve]] = {}
        self.candidates: list[EffectCandidate] = [EffectCandidate(effect) for effect in effects]

    def hypothesis(self, chosen: Sequence[int]) -> Hypothesis:
        """These candidates as effects."""
        return Hypothesis(tuple(self.candidates[number].effect for number in chosen))

    @property
    def remainder(self) -> float:
        """See `TermProblem`."""
        return REMAINDER if self._baseline.appears else EXACT

    def residuals(self, chosen: Sequence[int], theta: NDArray[np.float64]) -> Residuals | None:
        """See `TermProblem`."""
        return Sizing(self._likelihood, self._nominal, self.hypothesis(chosen)).residuals(theta)

    def tailored(self, about: TermFit, equations: Sequence[str], each: Each) -> Sequence[int]:
        """See `TermProblem`."""
        known = [TermEquation(one) for one in equations if one in set(TermEquation)]
        where = known[:TAILORED_FURTHER] if about.chosen else CURVES
        curves = self._curves(about, tuple(where), each)
        swings = self._waves(about.residuals)
        found = made_to_measure(curves, swings, self._beside(about), about.residuals, each)
        return [self.number_of(one) for one in found]

    def tabulated(self, about: TermFit, each: Each) -> Sequence[int]:
        """See `TermProblem`."""
        curves = self._curves(about, tuple(CURVES), each)
        return [self.number_of(one) for one in tables(curves, self._beside(about), about.residuals, each)]

    def _beside(self, about: TermFit) -> Callable[[Sequence[Effect]], "InjectorTerms"]:
        """Terms as a problem about the model of a fit."""
        model = self.hypothesis(about.chosen).model(self._nominal, about.theta)
        return lambda effects: InjectorTerms(self._likelihood, model, effects, self._baseline)

    def _curves(self, about: TermFit, equations: tuple[TermEquation, ...], each: Each) -> Sequence[FreeCurve]:
        """Free curves in these equations, found once."""
        key = (about.chosen, equations)
        if key not in self._known_curves:
            every = [(equation, *one) for equation in equations for one in CURVES.get(equation, ())]
            self._known_curves[key] = free_curves(every, self._beside(about), about.residuals, each)
        return self._known_curves[key]

    def _waves(self, left: Residuals) -> list[tuple[Effect, Effect]]:
        """Finds waves of frequencies that stand out of the residuals."""
        by_group = np.split(left.z, np.cumsum(left.counts)[:-1])  # line pressure and rate in turn
        times = [recorded.times for recorded in self._likelihood.recordings]
        found = lines(by_group[::2], times, self._likelihood.recordings[0].measurement.interval)
        return waves(found, max(float(one[-1] - one[0]) for one in times))

    def sharpened(self, chosen: Sequence[int], theta: NDArray[np.float64]) -> tuple[int, ...] | None:
        """See `TermProblem`."""
        effects = self.hypothesis(chosen).effects
        freed = Hypothesis(tuple(form_freed(effect) for effect in effects))
        if len(freed.parameters) == len(chosen):
            return None
        start = [
            value
            for effect, size in zip(freed.effects, theta, strict=True)
            for value in (size, *(one.starts[0] for one in effect.parameters[1:]))
        ]
        found = fit(
            Sizing(self._likelihood, self._nominal, freed), np.array(start), freed.ranges(), ITERATIONS
        )
        if found is None:
            return None
        parts = zip(effects, freed.split(found.theta), strict=True)
        return tuple(self.number_of(form_settled(effect, values[1:].tolist())) for effect, values in parts)

    def number_of(self, effect: Effect) -> int:
        """The number of a candidate, which may be new."""
        candidate = EffectCandidate(effect)
        if candidate not in self.candidates:
            self.candidates.append(candidate)
        return self.candidates.index(candidate)

    def is_adequate(self, chosen: Sequence[int], theta: NDArray[np.float64]) -> bool:
        """See `TermProblem`."""
        judged = self._likelihood.judge(self.hypothesis(chosen).model(self._nominal, theta))
        if judged is None:
            return False
        pool = pool_of(self._likelihood, judged)
        return worst(pool, self._baseline).ratio <= 1.0 or bool(chosen and self._is_remainder(pool))

    def _is_remainder(self, pool: Pool) -> bool:
        """Whether so little is left of what there was in every phase that it may be the model's own error."""
        if self._before is None:
            judged = self._likelihood.judge(self._nominal)
            assert judged is not None  # the search began with it
            self._before = pool_of(self._likelihood, judged)
        for signal, statistics in pool.items():
            for phase in Phase:
                healthy = VARIANCE_LIMIT[signal] * healthy_level(self._baseline, signal, phase)[0]
                excess = statistics.variance(phase) - healthy
                if excess > self.remainder * max(0.0, self._before[signal].variance(phase) - healthy):
                    return False
        return True


@dataclass(frozen=True)
class EffectCandidate:
    """An effect with one size as a `CandidateTerm`."""

    effect: Effect

    @property
    def equation(self) -> str:
        """Equation of a term, and of an effect that is one; else where the effect sits."""
        law = self.effect.apply
        if isinstance(law, TermLaw):
            return law.equation
        return LAWS_OF_EFFECTS.get(self.effect.id, (self.effect.place, ""))[0]

    @property
    def range(self) -> Range:
        """Bounds, and a step that noise does not drown."""
        size = self.effect.parameters[0]
        step = STEP * size.highest if is_term(self.effect) else 0.5 * size.dead_zone
        return Range(size.lowest, size.highest, step)

    @property
    def numbers(self) -> int:
        """See `CandidateTerm`."""
        law = self.effect.apply
        return len(law.numbers) if isinstance(law, TermLaw) else 0
