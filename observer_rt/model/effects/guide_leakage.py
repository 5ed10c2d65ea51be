"""Leak past the needle guide."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (leakage,) = values
    return model.with_departures(leakage=model.departures.leakage + leakage)


EFFECT = Effect(
    id="guide_leakage",
    effect_class=EffectClass.DYNAMICS,
    place=Place.CLOSED_END,
    equation=Equation.LINE_PRESSURE,
    parameters=(
        EffectParameter(
            "c", "m3/(s Pa)", 1.0, off=0.0, lowest=0.0, highest=5e-13, dead_zone=5e-16, starts=(0.0,)
        ),
    ),
    sentence="Fuel leaks past the needle guide, open or shut: c (p_L - p_C) drains the line.",
    signature=(
        "The line pressure stands a little below the rail pressure all the time and its ringing dies sooner."
    ),
    apply=_apply,
)
