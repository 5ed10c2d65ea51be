"""Needle-lift sensor with an offset."""

from collections.abc import Sequence

from observer_rt.foundation.units import MICROMETRE
from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (offset,) = values
    return model.with_inputs(lift_shift=model.inputs.lift_shift + offset)


EFFECT = Effect(
    id="lift_offset",
    effect_class=EffectClass.INPUT,
    place=Place.LIFT_SENSOR,
    equation=Equation.INPUT,
    parameters=(
        EffectParameter(
            "x_0",
            "um",
            MICROMETRE,
            off=0.0,
            lowest=-60 * MICROMETRE,
            highest=60 * MICROMETRE,
            dead_zone=0.2 * MICROMETRE,
            starts=(0.0,),
        ),
    ),
    sentence=(
        "The needle is higher than recorded by x_0 while it is open (sensor offset, a bent stem): "
        "measured = true - x_0."
    ),
    signature=(
        "Opening and closing are off by x_0 of lift: for x_0 > 0 flow begins before the recorded "
        "lift does and ends after it."
    ),
    apply=_apply,
)
