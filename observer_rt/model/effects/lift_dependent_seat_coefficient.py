"""Seat whose flow coefficient depends on the lift."""

from collections.abc import Sequence

from observer_rt.foundation.units import MICROMETRE
from observer_rt.model.departures import NO_DEPARTURES
from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    loss, lift = values
    before = model.departures
    if before.seat_loss != 0.0:
        lift = before.seat_loss_lift  # one scale of lift: what is added changes the loss in force
    return model.with_departures(seat_loss=before.seat_loss + loss, seat_loss_lift=lift)


EFFECT = Effect(
    id="lift_dependent_seat_coefficient",
    effect_class=EffectClass.DYNAMICS,
    place=Place.SEAT,
    equation=Equation.SAC_PRESSURE,
    parameters=(
        EffectParameter(
            "a", "-", 1.0, off=0.0, lowest=-0.8, highest=0.95, dead_zone=0.01, starts=(-0.2, -0.03, 0.03, 0.2)
        ),
        EffectParameter(
            "x_c",
            "um",
            MICROMETRE,
            off=NO_DEPARTURES.seat_loss_lift,
            lowest=10 * MICROMETRE,
            highest=200 * MICROMETRE,
            dead_zone=0.0,
            starts=(30 * MICROMETRE, 90 * MICROMETRE),
        ),
    ),
    sentence="The seat passes less (or more) at small lift than at full lift: alpha_S (1 - a exp(-x_N/x_c)).",
    signature="Shows in the first and last moments of an opening; ballistic injections lose most.",
    apply=_apply,
)
