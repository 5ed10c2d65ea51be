"""Slow line-pressure sensor."""

from collections.abc import Sequence

from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (lag,) = values
    return model.with_sensor(lag=model.sensor.lag + lag)


EFFECT = Effect(
    id="line_pressure_sensor_lag",
    effect_class=EffectClass.SENSOR,
    place=Place.LINE_SENSOR,
    equation=Equation.OUTPUT,
    parameters=(
        EffectParameter(
            "tau",
            "us",
            MICROSECOND,
            off=0.0,
            lowest=0.0,
            highest=500 * MICROSECOND,
            dead_zone=2 * MICROSECOND,
            starts=(0.0, 30 * MICROSECOND, 120 * MICROSECOND),
        ),
    ),
    sentence="The line-pressure sensor follows its pressure with a delay: tau y' = p_L - y.",
    signature=(
        "Steep changes of the line pressure are recorded late and rounded, at opening, closing "
        "and while it rings."
    ),
    apply=_apply,
)
