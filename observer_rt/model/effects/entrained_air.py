"""Air in the fuel of the line."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (share,) = values
    return model.with_departures(air=model.departures.air + share)


EFFECT = Effect(
    id="entrained_air",
    effect_class=EffectClass.DYNAMICS,
    place=Place.CLOSED_END,
    equation=Equation.LINE_PRESSURE,
    parameters=(
        EffectParameter(
            "g", "-", 1.0, off=0.0, lowest=0.0, highest=0.03, dead_zone=3e-5, starts=(0.0, 2e-3, 6e-3, 0.015)
        ),
    ),
    sentence="Air in the fuel makes the line softer, most at low pressure: 1/K_eff = 1/K + g/p.",
    signature="The line rings slower, the more so the lower the rail pressure.",
    apply=_apply,
)
