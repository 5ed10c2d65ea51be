"""Effects found on top of those in force, as one total for each: what the amended file must say."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.discovery.evidence.measurement import Measurement
from observer_rt.discovery.report.gaps import winner_of
from observer_rt.discovery.result import Discovery, FittedEffect, FittedParameter
from observer_rt.discovery.search.bounded_fit import NORMAL_975
from observer_rt.discovery.search.hypothesis import Sizing, sized_from
from observer_rt.discovery.search.likelihood import evidence_of
from observer_rt.foundation.errors import RunError
from observer_rt.model.effects import effective_model, sized_in_force
from observer_rt.model.parameters import EffectInForce, InjectorParameters


@dataclass(frozen=True)
class Amendment:
    """Effects to be in force: those of the file that stay, and those found with their total sizes."""

    kept: tuple[EffectInForce, ...]
    found: tuple[FittedEffect, ...]


def amendment(parameters: InjectorParameters, found: Discovery, measured: Sequence[Measurement]) -> Amendment:
    """What the amended file says. Raises `RunError` when totals cannot be fitted.

    An effect that is in force already and found again is fitted anew, from the model without it.
    """
    ids = {effect.id for effect in found.effects}
    kept = tuple(effect for effect in parameters.effects if effect.id not in ids)
    again = {effect.id: sized_in_force(effect).values for effect in parameters.effects if effect.id in ids}
    if not again:
        return Amendment(kept, found.effects)
    base = effective_model(parameters.model_copy(update={"effects": kept}))
    hypothesis, theta = winner_of(found)
    start = np.concatenate(
        [
            values + np.array(again.get(effect.id, [0.0] * values.size))
            for effect, values in zip(hypothesis.effects, hypothesis.split(theta), strict=True)
        ]
    )
    fitted = sized_from(Sizing(evidence_of(measured, base), base, hypothesis), [start])
    if fitted is None:
        raise RunError(f"{', '.join(again)}: the size in force and the one found make no model together")
    spread = math.sqrt(max(1.0, float(np.mean(fitted.at.residuals.z**2))))
    halves = hypothesis.split(NORMAL_975 * spread * fitted.sigmas())
    totals = []
    for effect, values, half in zip(found.effects, hypothesis.split(fitted.at.theta), halves, strict=True):
        parts = tuple(
            FittedParameter(p.name, float(v), (float(v - h), float(v + h)))
            for p, v, h in zip(effect.parameters, values, half, strict=True)
        )
        totals.append(
            FittedEffect(effect.id, parts, effect.gain, effect.confidence, effect.indistinguishable_from)
        )
    return Amendment(kept, tuple(totals))
