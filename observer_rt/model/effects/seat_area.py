"""Needle seat worn wider, or with deposits."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (change,) = values
    return model.with_section("seat", flow_coefficient=1.0 + change)


EFFECT = Effect(
    id="seat_area",
    effect_class=EffectClass.DYNAMICS,
    place=Place.SEAT,
    equation=Equation.SAC_PRESSURE,
    parameters=(
        EffectParameter("v_S", "-", 1.0, off=0.0, lowest=-0.8, highest=1.5, dead_zone=0.01, starts=(0.0,)),
    ),
    sentence="The needle seat passes more fuel at the same lift, or less: Q_S (1 + v_S).",
    signature="Shows at opening and closing, while the seat throttles, and hardly at full lift.",
    apply=_apply,
)
