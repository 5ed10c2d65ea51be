"""Effects in nozzle, seat and chamber: what the needle lets through."""

from collections.abc import Sequence
from dataclasses import replace

from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.model.effect import (
    BALLISTIC_RATE,
    Component,
    Effect,
    Likeness,
    Relation,
    added,
    parameter,
    scaled,
)
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import NO_DEPARTURES

ORIFICE_AREA = Effect(
    id="orifice_area",
    component=Component.NOZZLE,
    parameters=(parameter("v_H", -0.8, 1.5, 0.003),),
    apply=scaled("nozzle", "flow_coefficient"),
    sentence=("The spray holes pass more fuel than the new ones (erosion), or less (coking): Q_H (1 + v_H)."),
    signature=(
        "While the needle is open the line pressure sags by more (or less), in proportion to the flow, "
        "at every rail pressure; nothing changes while it is shut."
    ),
    relations=(Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.NEAR, BALLISTIC_RATE),),
    wear=True,
)

ORIFICE_CAVITATION = Effect(
    id="orifice_cavitation",
    component=Component.NOZZLE,
    parameters=(parameter("n_crit_excess", 0.0, 0.6, 0.02, (0.06, 0.12, 0.3)),),
    apply=added("departures", "critical_excess"),
    sentence=(
        "The spray holes cavitate at high pressure: below N_crit their coefficient falls by "
        "sqrt(N/N_crit), N = (p_S - p_v)/(p_S - p_C)."
    ),
    signature="Less flow at high rail pressure only; below a rail pressure set by N_crit nothing changes.",
)

SEAT_AREA = Effect(
    id="seat_area",
    component=Component.SEAT,
    parameters=(parameter("v_S", -0.8, 1.5, 0.01),),
    apply=scaled("seat", "flow_coefficient"),
    sentence="The needle seat passes more fuel at the same lift, or less: Q_S (1 + v_S).",
    signature="Shows at opening and closing, while the seat throttles, and hardly at full lift.",
    relations=(Relation(("lift_dependent_seat_coefficient",), Likeness.ALIKE, BALLISTIC_RATE),),
    wear=True,
)


def _lift_dependent_seat_coefficient(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    loss, lift = values
    before = model.departures
    if before.seat_loss != 0.0:
        lift = before.seat_loss_lift  # one scale of lift: what is added changes the loss in force
    return model.with_terms("departures", seat_loss=before.seat_loss + loss, seat_loss_lift=lift)


LIFT_DEPENDENT_SEAT_COEFFICIENT = Effect(
    id="lift_dependent_seat_coefficient",
    component=Component.SEAT,
    parameters=(
        parameter("a", -0.8, 0.95, 0.01, (-0.2, -0.03, 0.03, 0.2)),
        replace(
            parameter("x_c", 10.0, 200.0, 0.0, (30.0, 90.0), "um", MICROMETRE),
            off=NO_DEPARTURES.seat_loss_lift,
        ),
    ),
    apply=_lift_dependent_seat_coefficient,
    sentence=(
        "The seat passes less (or more) at small lift than at full lift: alpha_S (1 - a exp(-x_N/x_c))."
    ),
    signature="Shows in the first and last moments of an opening; ballistic injections lose most.",
)


def _chamber_pressure_rise(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    rise, share = values
    before = model.departures
    return model.with_terms(
        "departures",
        chamber_rise=before.chamber_rise + (1.0 - share) * rise,
        chamber_rise_with_seat=before.chamber_rise_with_seat + share * rise,
    )


CHAMBER_PRESSURE_RISE = Effect(
    id="chamber_pressure_rise",
    component=Component.CHAMBER,
    parameters=(
        parameter("dp", 0.0, 40.0, 0.2, (2.0,), unit="MPa", si=MEGAPASCAL),
        parameter("s", 0.0, 1.0, 0.0, (0.0, 1.0)),
    ),
    apply=_chamber_pressure_rise,
    sentence=(
        "The pressure behind the nozzle rises with the needle, by dp at full lift: a share s of it in proportion to "
        "the seat's area, the rest at once."
    ),
    signature="Less flow while the needle is open, by a share that grows towards low rail pressure.",
)
