"""Hypotheses of the missing effect: effects with free sizes, fitted to recordings from several starts."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.likelihood.bounded_fit import MAX_ITERATIONS, Minimum, Range, Residuals, fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood
from observer_rt.model.effect import Effect, EffectParameter
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import LAWS_OF_EFFECTS, TermLaw, is_term

DEAD_SHARE = 0.75  # of the dead zone: estimates of an effect just beyond it scatter
# Of the dead zone, for finite differences: noise does not drown that of a term.
_STEP, _STEP_OF_TERM = 0.01, 5.0
_SHAPE_STEP = 1e-4  # of the range, for parameters without dead zone
MOST_STARTS = 2  # from which a search begins
_EXPLAINED = 1.1  # variance of the residuals below which no second start is tried


@dataclass(frozen=True)
class Hypothesis:
    """Effects in force beyond the nominal model; parameters theta (p,) in SI, effect after effect."""

    effects: tuple[Effect, ...] = ()

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the effects."""
        return tuple(effect.id for effect in self.effects)

    @property
    def parameters(self) -> tuple[EffectParameter, ...]:
        """Parameters of all effects, as in theta."""
        return tuple(parameter for effect in self.effects for parameter in effect.parameters)

    def with_effect(self, effect: Effect) -> "Hypothesis":
        """One effect more, at the end."""
        return Hypothesis((*self.effects, effect))

    def split(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """theta by effects."""
        ends = np.cumsum([len(effect.parameters) for effect in self.effects])
        return tuple(np.split(theta, ends[:-1])) if self.effects else ()

    def model(self, nominal: EffectiveModel, theta: NDArray[np.float64]) -> EffectiveModel:
        """The nominal model with these effects at these sizes."""
        for effect, values in zip(self.effects, self.split(theta), strict=True):
            nominal = effect.apply(nominal, tuple(float(value) for value in values))
        return nominal

    def ranges(self) -> tuple[Range, ...]:
        """Bounds and steps of theta."""
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

    def starts(self) -> list[NDArray[np.float64]]:
        """Starts of a search: all combinations of the starts of the last effect, the others off."""
        if not self.effects:
            return [np.zeros(0)]
        before = [p.off for effect in self.effects[:-1] for p in effect.parameters]
        grids = product(*(p.starts for p in self.effects[-1].parameters))
        return [np.array([*before, *values]) for values in grids]

    def is_plausible(self, theta: NDArray[np.float64]) -> bool:
        """Whether every effect has a size that matters and that no bound holds back: the sizes, not the shapes."""
        return self.is_within_bounds(theta) and all(
            abs(value - p.off) > DEAD_SHARE * p.dead_zone for p, value in self._sizes(theta)
        )

    def is_within_bounds(self, theta: NDArray[np.float64]) -> bool:
        """Whether no bound but `off` holds a size back."""
        return all(value == p.off or p.lowest < value < p.highest for p, value in self._sizes(theta))

    def _sizes(self, theta: NDArray[np.float64]) -> list[tuple[EffectParameter, float]]:
        pairs = zip(self.parameters, theta, strict=True)
        return [(p, float(value)) for p, value in pairs if p.dead_zone > 0.0]


def equation_of(effect: Effect) -> str:
    """Equation that an effect corrects; of one that is no law the place where it sits."""
    law = effect.apply
    if isinstance(law, TermLaw):
        return law.equation
    return LAWS_OF_EFFECTS.get(effect.id, (effect.component, ""))[0]


class Sizing:
    """The problem of finding the sizes of a hypothesis' effects."""

    def __init__(self, likelihood: JointLikelihood, nominal: EffectiveModel, hypothesis: Hypothesis) -> None:
        self._likelihood = likelihood
        self._nominal = nominal
        self.hypothesis = hypothesis

    def residuals(self, theta: NDArray[np.float64]) -> Residuals | None:
        """Residuals on all recordings with effects of these sizes."""
        return self._likelihood.residuals(self.hypothesis.model(self._nominal, theta))


def minimum_from(
    sizing: Sizing,
    starts: Sequence[NDArray[np.float64]],
    max_iterations: int = MAX_ITERATIONS,
    second_if_stuck: bool = False,
) -> Minimum | None:
    """Best fit from the most promising start, or two; None when the model has no solution at any of them.

    second_if_stuck: a second start is tried only where the first fit got stuck.
    """
    tried = []
    for start in starts:
        residuals = sizing.residuals(start)
        if residuals is not None:
            tried.append((start, residuals))
    tried.sort(key=lambda item: item[1].statistic)
    ranges = sizing.hypothesis.ranges()
    best: Minimum | None = None
    for start, residuals in tried[:MOST_STARTS]:
        minimum = fit(sizing, start, ranges, max_iterations, residuals)
        if minimum is not None and (best is None or minimum.statistic < best.statistic):
            best = minimum
        if best is None or (second_if_stuck and best.stuck):
            continue
        if second_if_stuck or np.mean(best.residuals.z**2) < _EXPLAINED:
            break
    return best
