"""Volume of the line."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (change,) = values
    return model.with_section("line", volume=1.0 + change)


EFFECT = Effect(
    id="line_volume",
    effect_class=EffectClass.DYNAMICS,
    place=Place.CLOSED_END,
    equation=Equation.LINE_PRESSURE,
    parameters=(
        EffectParameter(
            "r",
            "-",
            1.0,
            off=0.0,
            lowest=-0.5,
            highest=1.5,
            dead_zone=0.001,
            starts=(-0.3, -0.13, 0.0, 0.14, 0.43),
        ),
    ),
    sentence="The line holds more fuel, or less, than the file says: V_L (1 + r).",
    signature="The line rings slower or faster at every rail pressure; the injected mass hardly changes.",
    apply=_apply,
    indistinguishable=("bulk_modulus",),
)
