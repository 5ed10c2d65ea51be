"""Line pressure recorded late, or early."""

from collections.abc import Sequence

from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (delay,) = values
    return model.with_sensor(delay=model.sensor.delay + delay)


EFFECT = Effect(
    id="channel_skew",
    effect_class=EffectClass.SENSOR,
    place=Place.LINE_SENSOR,
    equation=Equation.OUTPUT,
    parameters=(
        EffectParameter(
            "d",
            "us",
            MICROSECOND,
            off=0.0,
            lowest=-60 * MICROSECOND,
            highest=60 * MICROSECOND,
            dead_zone=2 * MICROSECOND,
            starts=(-20 * MICROSECOND, 0.0, 20 * MICROSECOND),
        ),
    ),
    sentence=(
        "The line pressure is recorded late (or early) against rail pressure and lift by d: other "
        "filters, other clocks."
    ),
    signature="The whole line pressure is shifted in time; steep changes show it, their shape stays.",
    apply=_apply,
)
