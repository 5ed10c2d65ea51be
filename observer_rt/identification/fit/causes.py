"""Possible causes of the residuals of a fit: effects of the vocabulary, the likeliest tried by refits with them."""

from dataclasses import dataclass

import numpy as np

from observer_rt.identification.fit.forms import EffectSize
from observer_rt.identification.fit.problem import Calibration
from observer_rt.identification.fit.search import FittedStructure, fitted
from observer_rt.model.effect import Effect
from observer_rt.model.effects import VOCABULARY, seen_in

MOST_REFITS = 2  # of the likeliest
LEAST_PROMISE = 0.1  # of what is left, that an effect must explain to first order to be worth a refit
REFIT_ITERATIONS = 30  # of a refit: the parameters stood in for the effect, and have a long way back
LEAST_OWN_SHARE = 1e-3  # of what an effect does, that the fitted parameters cannot do
EXPLAINED_SHARE = 0.1  # of a mean chi2 beyond noise, up to which an effect explains it


@dataclass(frozen=True, eq=False)
class TriedCause:
    """An effect, and the structure fitted again with it; before: mean chi2 without the effect."""

    effect: Effect
    fit: FittedStructure
    before: float

    @property
    def explains(self) -> bool:
        """Whether the residuals are small with the effect."""
        return self.fit.unexplained.mean - 1.0 <= EXPLAINED_SHARE * min(self.before - 1.0, 10.0)

    @property
    def is_of_bench(self) -> bool:
        """Whether the effect is a sensor's: then the recordings are wrong, not the model."""
        return self.effect.component.endswith("_sensor")

    @property
    def words(self) -> str:
        """Such as `lift_offset x_0 = 9.8 um: chi2 1.1 for 3.3`, each in the mean."""
        first = self.effect.parameters[0]
        value = EffectSize.of_effect(self.effect).of(self.fit.injector) / first.si
        unit, after = "" if first.unit == "-" else f" {first.unit}", self.fit.unexplained.mean
        return f"{self.effect.id} {first.name} = {value:.3g}{unit}: chi2 {after:.3g} for {self.before:.3g}"


def tried_causes(best: FittedStructure) -> tuple[TriedCause, ...]:
    """The likeliest causes of a structure's residuals, the best first; empty if no effect promises much."""
    sizes = [EffectSize.of_effect(one) for one in seen_in(has_lift=True) if one.parameters]
    gains = {size: _gain(best, size) for size in sizes}
    left = best.minimum.at.residuals
    promising = [one for one in sizes if gains[one] > LEAST_PROMISE * (left.squares - left.z.size)]
    tried = []
    for size in sorted(promising, key=lambda one: -gains[one])[:MOST_REFITS]:
        free = (*best.calibration.free, size)
        again = fitted(best.structure, best.injector, free, best.calibration.folds, REFIT_ITERATIONS)
        if isinstance(again, FittedStructure):
            tried.append(TriedCause(VOCABULARY[size.key], again, best.unexplained.mean))
    return tuple(sorted(tried, key=lambda one: one.fit.unexplained.mean))


def _gain(best: FittedStructure, size: EffectSize) -> float:
    """Fall of -2 log L to first order, by the part of an effect's change that no fitted parameter can make."""
    at, free = best.minimum.at, best.calibration.free
    calibration = Calibration(best.injector, (*free, size), best.calibration.folds)
    moved = calibration.residuals(np.insert(at.theta, len(free), 1.0))
    if moved is None:
        return 0.0
    data = at.residuals.z.size - at.theta.size  # the prior's come after
    here, roots = at.residuals.z[:data], at.residuals.roots[:data]
    change, left = roots * (moved.z[:data] - here), roots * here
    shared = at.slopes[:data].T @ change
    as_parameters = np.linalg.pinv(at.information, hermitian=True) @ shared
    own = float(change @ change - shared @ as_parameters)
    slope = float(change @ left - as_parameters @ at.gradient)
    if own <= LEAST_OWN_SHARE * float(change @ change):
        return 0.0
    steps = float(np.clip(-slope / own, size.lowest / size.linear, size.highest / size.linear))
    return -steps * (2.0 * slope + steps * own)
