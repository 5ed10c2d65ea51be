"""Line-pressure sensor with an offset."""

from collections.abc import Sequence

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (offset,) = values
    return model.with_sensor(offset=model.sensor.offset + offset)


EFFECT = Effect(
    id="line_pressure_sensor_offset",
    effect_class=EffectClass.SENSOR,
    place=Place.LINE_SENSOR,
    equation=Equation.OUTPUT,
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
    sentence="The line pressure is recorded too high (or too low) by the same pressure always: y = p_L + o.",
    signature=(
        "With the needle shut the line pressure differs from the rail pressure by the same amount "
        "at every pressure."
    ),
    apply=_apply,
)
