"""Explanations of the missing effect: effects with free sizes, and those that were fitted, each with its price."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from observer_rt.foundation.units import Floats, shown, sign, significant
from observer_rt.identification.likelihood.bounded_fit import MAX_ITERATIONS, Minimum, Problem, Range, fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood
from observer_rt.identification.likelihood.open_loop import NO_CONSEQUENCE, Consequence
from observer_rt.model.effect import Effect, EffectParameter
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import EffectValue, Finite
from observer_rt.model.term_effect import LAWS_OF_EFFECTS, TermLaw, is_term, term_of
from observer_rt.model.terms.term import Term

DEAD_SHARE = 0.75  # of the dead zone: estimates of an effect just beyond it scatter
_STEP, _STEP_OF_TERM = 0.01, 5.0  # Of the dead zone, for finite differences: noise does not drown that of a term.
_SHAPE_STEP = 1e-4  # of the range, for parameters without dead zone
MOST_STARTS = 2  # from which a search begins
_EXPLAINED_VARIANCE = 1.1  # variance of the residuals below which no second start is tried
PRICE = 10.0  # of -2 log L for each number fitted, log(n): which of two near-ties leads
LAW_ODDS, FURTHER_ODDS = 50.0, 50.0
"""Prior odds, as -2 log L: of an explanation by a law without a name, and of every effect after the first."""
_DIGITS = 8  # of printed values: far below any interval, free of conversion noise


CandidateKey = tuple[tuple[str, ...], tuple[float, ...]]  # ids of effects, and their sizes


@dataclass(frozen=True)
class Hypothesis:
    """Effects in force beyond the nominal model; parameters theta (p,) in SI, effect after effect."""

    effects: tuple[Effect, ...] = ()

    @property
    def ids(self) -> tuple[str, ...]:
        return tuple(effect.id for effect in self.effects)

    @property
    def parameters(self) -> tuple[EffectParameter, ...]:
        """Parameters of all effects, as in theta."""
        return tuple(parameter for effect in self.effects for parameter in effect.parameters)

    def with_effect(self, effect: Effect) -> "Hypothesis":
        """One effect more, at the end."""
        return Hypothesis((*self.effects, effect))

    def split(self, theta: Floats) -> tuple[Floats, ...]:
        """theta by effects."""
        ends = np.cumsum([len(effect.parameters) for effect in self.effects])
        return tuple(np.split(theta, ends[:-1])) if self.effects else ()

    def model(self, nominal: EffectiveModel, theta: Floats) -> EffectiveModel:
        for effect, values in zip(self.effects, self.split(theta), strict=True):
            nominal = effect.apply(nominal, tuple(float(value) for value in values))
        return nominal

    def ranges(self) -> tuple[Range, ...]:
        return tuple(
            Range(p.lowest, p.highest, share * p.dead_zone or _SHAPE_STEP * (p.highest - p.lowest))
            for effect in self.effects
            for share in (_STEP_OF_TERM if is_term(effect) else _STEP,)
            for p in effect.parameters
        )

    @property
    def equations(self) -> frozenset[str]:
        """Equations that it corrects: of a term its own, of an effect that is no law where it sits."""
        return frozenset(map(equation_of, self.effects))

    @property
    def numbers(self) -> tuple[int, ...]:
        """How many numbers within the law of each were fitted, too."""
        laws = (effect.apply for effect in self.effects)
        return tuple(len(law.numbers) if isinstance(law, TermLaw) else 0 for law in laws)

    @property
    def off(self) -> Floats:
        """Sizes without any of the effects."""
        return np.array([p.off for p in self.parameters])

    def starts(self) -> list[Floats]:
        """Starts of a search: all combinations of the starts of the last effect, the others off."""
        if not self.effects:
            return [np.zeros(0)]
        before = [p.off for effect in self.effects[:-1] for p in effect.parameters]
        grids = product(*(p.starts for p in self.effects[-1].parameters))
        return [np.array([*before, *values]) for values in grids]


class Size(EffectValue):
    """A fitted parameter with its 95 % interval, in its printed unit: as files have it."""

    ci95: tuple[Finite, Finite]

    @classmethod
    def of(cls, parameter: EffectParameter, value: float, low: float, high: float) -> "Size":
        """A size and the ends of its interval [SI]."""
        value, low, high = (float(f"{si / parameter.si:.{_DIGITS}g}") for si in (value, low, high))
        return cls(value=value, ci95=(low, high), unit=parameter.unit)

    @property
    def digits(self) -> tuple[str, str, str]:
        """The value and the ends of its interval, digits as the interval deserves."""
        step = significant(max(self.ci95[1] - self.value, self.value - self.ci95[0]))
        return shown(self.value, step), shown(self.ci95[0], step), shown(self.ci95[1], step)


def size_words(sizes: Mapping[str, Size], level: str) -> list[str]:
    """Such as `v_H = 0.301 (0.295 to 0.307)`. level: before the interval."""
    words = []
    for name, size in sizes.items():
        value, low, high = size.digits
        unit = f" {sign(size.unit)}".rstrip()
        words.append(f"{name} = {value}{unit} ({level}{low} to {high}{unit})")
    return words


@dataclass(frozen=True)
class Candidate:
    """A combination of effects fitted to all recordings; the nominal model is the one without effects."""

    hypothesis: Hypothesis
    sizes: tuple[float, ...]  # (p,) SI, effect after effect
    statistic: float  # -2 log L, constants left out
    spread: float = 1.0  # mean square of the residuals as the statistic counts it, 1 at least
    own_error: float = 0.0  # of -2 log L: what laws gain over a name that may be the fitted model's own error
    half: tuple[float, ...] = ()  # (p,) half widths of the 95 % intervals; as all below, of a ranking or a proposal
    sizes_of_half: tuple[float, ...] = ()  # fitted to every second operating point
    held_out: float = math.nan  # -2 log L so fitted and judged on the others; nan: not done, or in no ranking
    moves: Consequence = NO_CONSEQUENCE  # what it does to the model as given

    @property
    def price(self) -> float:
        """-2 log L, what every number fitted costs, the prior odds, and what may be the model's own error."""
        numbers = PRICE * (len(self.sizes) + sum(self.hypothesis.numbers)) * self.spread
        odds = LAW_ODDS * bool(self.terms) + FURTHER_ODDS * max(len(self.ids) - 1, 0)
        return self.statistic + numbers + odds + self.own_error

    @property
    def key(self) -> CandidateKey:
        """Effects and sizes: of two candidates with the same all else is."""
        return self.ids, self.sizes

    @property
    def theta(self) -> Floats:
        """The sizes as a vector (p,)."""
        return np.array(self.sizes)

    @property
    def ids(self) -> tuple[str, ...]:
        return self.hypothesis.ids

    @property
    def named(self) -> tuple[str, ...]:
        """Ids of the effects of the vocabulary among them: those that are no terms."""
        return tuple(effect.id for effect in self.hypothesis.effects if not is_term(effect))

    @property
    def plausible(self) -> bool:
        """Whether every effect has a size that matters and that no bound holds back: the sizes, not the shapes."""
        matter = (abs(value - p.off) > DEAD_SHARE * p.dead_zone for p, value in self._by_size)
        return self.within_bounds and all(matter)

    @property
    def within_bounds(self) -> bool:
        """Whether no bound but `off` holds a size back."""
        return all(value == p.off or p.lowest < value < p.highest for p, value in self._by_size)

    @property
    def _by_size(self) -> list[tuple[EffectParameter, float]]:
        return [pair for pair in zip(self.hypothesis.parameters, self.sizes, strict=True) if pair[0].dead_zone > 0.0]

    @property
    def is_too_small(self) -> bool:
        """Whether a size within its bounds is too small to matter."""
        return self.within_bounds and not self.plausible

    @property
    def parts(self) -> tuple[tuple[Effect, Floats, Floats], ...]:
        """Every effect with its sizes, and their half widths where these are known."""
        split = self.hypothesis.split
        return tuple(zip(self.hypothesis.effects, split(self.theta), split(np.array(self.half)), strict=True))

    @property
    def parameters(self) -> dict[str, dict[str, Size]]:
        """The sizes of the effects of the vocabulary by id, their intervals cut at the bounds of physics."""
        return {
            effect.id: {
                p.name: Size.of(p, value, max(p.lowest, value - half), min(p.highest, value + half))
                for p, value, half in zip(effect.parameters, sizes.tolist(), halves.tolist(), strict=True)
            }
            for effect, sizes, halves in self.parts
            if not is_term(effect)
        }

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms among the effects, with 95 % intervals of their coefficients, cut at the bounds, where known."""
        fitted_terms = []
        for effect, size, half in self.parts:
            term = term_of(effect, float(size[0])) if size.size == 1 else None  # A coefficient is its only one.
            if term is not None:
                bounds = effect.parameters[0].lowest, effect.parameters[0].highest
                ends = [float(np.clip(term.coefficient + move, *bounds)) for one in half for move in (-one, one)]
                fitted_terms.append(replace(term, interval=(ends[0], ends[1])) if ends else term)
        return tuple(fitted_terms)

    def model(self, nominal: EffectiveModel) -> EffectiveModel:
        return self.hypothesis.model(nominal, self.theta)

    def without(self, effect: Effect) -> tuple[Hypothesis, Floats]:
        """All but one of the effects, and their sizes."""
        left = [(other, sizes) for other, sizes, _ in self.parts if other is not effect]
        return Hypothesis(tuple(other for other, _ in left)), np.concatenate([np.zeros(0), *(one for _, one in left)])


def equation_of(effect: Effect) -> str:
    """Equation that an effect corrects; of one that is no law the place where it sits."""
    law = effect.apply
    if isinstance(law, TermLaw):
        return law.equation
    return LAWS_OF_EFFECTS.get(effect.id, (effect.component, ""))[0]


def sizing(likelihood: JointLikelihood, nominal: EffectiveModel, hypothesis: Hypothesis) -> Problem:
    """The problem of finding the sizes of a hypothesis' effects."""
    return lambda theta: likelihood.residuals(hypothesis.model(nominal, theta))


def minimum_from(
    problem: Problem,
    ranges: Sequence[Range],
    starts: Sequence[Floats],
    max_iterations: int = MAX_ITERATIONS,
    second_if_stuck: bool = False,
) -> Minimum | None:
    """Best fit from the most promising start, or two (`second_if_stuck`: only then); None without a solution."""
    tried = [(start, residuals) for start in starts if (residuals := problem(start)) is not None]
    tried.sort(key=lambda item: item[1].statistic)
    best: Minimum | None = None
    for start, residuals in tried[:MOST_STARTS]:
        minimum = fit(problem, start, ranges, max_iterations, residuals)
        if minimum is not None and (best is None or minimum.statistic < best.statistic):
            best = minimum
        if best is None or (second_if_stuck and best.stuck):
            continue
        if second_if_stuck or np.mean(best.residuals.z**2) < _EXPLAINED_VARIANCE:
            break
    return best
