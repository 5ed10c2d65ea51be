"""Stiffness of the fuel in the line."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (change,) = values
    return model.with_section("fluid", bulk_modulus_line=1.0 + change)


EFFECT = Effect(
    id="bulk_modulus",
    effect_class=EffectClass.DYNAMICS,
    place=Place.CLOSED_END,
    equation=Equation.LINE_PRESSURE,
    parameters=(
        EffectParameter(
            "r",
            "-",
            1.0,
            off=0.0,
            lowest=-0.6,
            highest=1.0,
            dead_zone=0.001,
            starts=(-0.3, -0.12, 0.0, 0.15, 0.4),
        ),
    ),
    sentence=(
        "The fuel in the line is stiffer, or softer, than the file says (another fuel, another "
        "temperature): K_L (1 + r)."
    ),
    signature="The line rings faster or slower at every rail pressure; the injected mass hardly changes.",
    apply=_apply,
    indistinguishable=("line_volume",),
)
