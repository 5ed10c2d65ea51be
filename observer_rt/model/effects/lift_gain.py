"""Needle-lift sensor with a wrong scale."""

from collections.abc import Sequence

from observer_rt.model.effect import (
    LIFT_GAUGE,
    LIFT_GAUGE_OR_RATE,
    Effect,
    Likeness,
    Place,
    Relation,
    parameter,
)
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    return model.with_terms("inputs", lift_factor=model.inputs.lift_factor * (1.0 + values[0]))


EFFECT = Effect(
    id="lift_gain",
    place=Place.LIFT_SENSOR,
    parameters=(parameter("g", -0.3, 0.3, 0.003),),
    apply=_apply,
    sentence="The recorded lift is too small (or too large) by a factor: true = measured (1 + g).",
    signature="Like a wider (or narrower) seat: shows while the seat throttles, at small lift.",
    relations=(
        Relation(("lift_offset",), Likeness.ALIKE, LIFT_GAUGE),
        Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.ALIKE, LIFT_GAUGE_OR_RATE),
        Relation(("orifice_area",), Likeness.NEAR, LIFT_GAUGE_OR_RATE),
    ),
)
