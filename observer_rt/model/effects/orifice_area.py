"""Spray holes worn wider by cavitation erosion, or narrowed by coking."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (change,) = values
    return model.with_section("nozzle", flow_coefficient=1.0 + change)


EFFECT = Effect(
    id="orifice_area",
    effect_class=EffectClass.DYNAMICS,
    place=Place.NOZZLE,
    equation=Equation.LINE_PRESSURE,
    parameters=(
        EffectParameter("v_H", "-", 1.0, off=0.0, lowest=-0.8, highest=1.5, dead_zone=0.003, starts=(0.0,)),
    ),
    sentence="The spray holes pass more fuel than the new ones (erosion), or less (coking): Q_H (1 + v_H).",
    signature=(
        "While the needle is open the line pressure sags by more (or less), in proportion to the "
        "flow, at every rail pressure; nothing changes while it is shut."
    ),
    apply=_apply,
)
