"""Rail-pressure sensor with an offset."""

from collections.abc import Sequence

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (offset,) = values
    return model.with_inputs(rail_shift=model.inputs.rail_shift - offset * model.inputs.rail_factor)


EFFECT = Effect(
    id="rail_pressure_sensor_offset",
    effect_class=EffectClass.INPUT,
    place=Place.RAIL_SENSOR,
    equation=Equation.INPUT,
    parameters=(
        EffectParameter(
            "o",
            "MPa",
            MEGAPASCAL,
            off=0.0,
            lowest=-10 * MEGAPASCAL,
            highest=10 * MEGAPASCAL,
            dead_zone=0.02 * MEGAPASCAL,
            starts=(0.0,),
        ),
    ),
    sentence=(
        "The rail pressure is recorded too high (or too low) by the same pressure always: measured "
        "= true + o."
    ),
    signature=(
        "With the needle shut the line pressure differs from the recorded rail pressure by the "
        "same amount at every pressure."
    ),
    apply=_apply,
)
