"""Seat whose flow coefficient depends on the lift."""

from collections.abc import Sequence
from dataclasses import replace

from observer_rt.foundation.units import MICROMETRE
from observer_rt.model.effect import Effect, Place, parameter
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import NO_DEPARTURES


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    loss, lift = values
    before = model.departures
    if before.seat_loss != 0.0:
        lift = before.seat_loss_lift  # one scale of lift: what is added changes the loss in force
    return model.with_terms("departures", seat_loss=before.seat_loss + loss, seat_loss_lift=lift)


EFFECT = Effect(
    id="lift_dependent_seat_coefficient",
    place=Place.SEAT,
    parameters=(
        parameter("a", -0.8, 0.95, 0.01, (-0.2, -0.03, 0.03, 0.2)),
        replace(
            parameter("x_c", 10.0, 200.0, 0.0, (30.0, 90.0), "um", MICROMETRE),
            off=NO_DEPARTURES.seat_loss_lift,
        ),
    ),
    apply=_apply,
    sentence=(
        "The seat passes less (or more) at small lift than at full lift: alpha_S (1 - a exp(-x_N/x_c))."
    ),
    signature="Shows in the first and last moments of an opening; ballistic injections lose most.",
)
