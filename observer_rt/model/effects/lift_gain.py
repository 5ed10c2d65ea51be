"""Needle-lift sensor with a wrong scale."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (gain,) = values
    return model.with_inputs(lift_factor=model.inputs.lift_factor * (1.0 + gain))


EFFECT = Effect(
    id="lift_gain",
    effect_class=EffectClass.INPUT,
    place=Place.LIFT_SENSOR,
    equation=Equation.INPUT,
    parameters=(
        EffectParameter("g", "-", 1.0, off=0.0, lowest=-0.3, highest=0.3, dead_zone=0.003, starts=(0.0,)),
    ),
    sentence="The recorded lift is too small (or too large) by a factor: true = measured (1 + g).",
    signature="Like a wider (or narrower) seat: shows while the seat throttles, at small lift.",
    apply=_apply,
)
