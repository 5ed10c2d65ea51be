"""Effects in the hydraulics: of fuel, line, leak and pilot valve, of seat, nozzle and chamber."""

from collections.abc import Sequence
from dataclasses import replace

from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MM3_PER_MS
from observer_rt.model.effect import Component, Effect, Likeness, Proof, Relation, added, parameter, scaled
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.hydraulics import valve_of
from observer_rt.model.parameters import NO_DEPARTURES, LineOutflow

BULK_MODULUS = Effect(
    id="bulk_modulus",
    component=Component.CLOSED_END,
    parameters=(parameter("r", -0.6, 1.0, 0.001, (-0.3, -0.12, 0.0, 0.15, 0.4)),),
    apply=scaled("fluid", "bulk_modulus_line"),
    sentence=(
        "The fuel in the line is stiffer, or softer, than the file says (another fuel, another temperature): K_L "
        "(1 + r), of a fuel that stiffens K_0 (1 + r)."
    ),
    signature="The line rings faster or slower at every rail pressure; the injected mass hardly changes.",
    relations=(Relation(("line_volume",), Likeness.SAME, Proof.FUEL_OR_DRAWING),),
)

PRESSURE_DEPENDENT_BULK_MODULUS = Effect(
    id="pressure_dependent_bulk_modulus",
    component=Component.CLOSED_END,
    parameters=(parameter("n", -8.0, 12.0, 0.01, (-3.0, 0.0, 3.0, 8.0)),),
    apply=added("departures", "stiffness_slope"),
    sentence="The fuel in the line stiffens with its pressure: K = K_0 + n (p - 100 MPa).",
    signature="The line rings slower below 100 MPa and faster above.",
)

ENTRAINED_AIR = Effect(
    id="entrained_air",
    component=Component.CLOSED_END,
    parameters=(parameter("g", 0.0, 0.03, 3e-5, (0.0, 2e-3, 6e-3, 0.015)),),
    apply=added("departures", "air"),
    sentence="Air in the fuel makes the line softer, most at low pressure: 1/K_eff = 1/K + g/p.",
    signature="The line rings slower, the more so the lower the rail pressure.",
)

FUEL_DENSITY = Effect(
    id="fuel_density",
    component=Component.LINE_FLOW,
    parameters=(parameter("r", -0.2, 0.2, 0.001, (-0.1, 0.0, 0.1)),),
    apply=scaled("fluid", "density_line", "density_nozzle"),
    sentence="The fuel is denser, or lighter, than the file says, in line and nozzle: rho (1 + r).",
    signature="All flows change as one over the root of the density; the denser the fuel, the slower the line rings.",
    decided_by=Proof.SAMPLE_OR_BALANCE,
)

LINE_VOLUME = Effect(
    id="line_volume",
    component=Component.CLOSED_END,
    parameters=(parameter("r", -0.5, 1.5, 0.001, (-0.3, -0.13, 0.0, 0.14, 0.43)),),
    apply=scaled("line", "volume"),
    sentence="The line holds more fuel, or less, than the file says: V_L (1 + r).",
    signature="The line rings slower or faster at every rail pressure; the injected mass hardly changes.",
)

LINE_FRICTION = Effect(
    id="line_friction",
    component=Component.LINE_FLOW,
    parameters=(parameter("k", -0.95, 10.0, 0.005, (0.0, 2.0)),),
    apply=scaled("line", "loss_factor"),
    sentence="The feed line loses more pressure to its flow (deposits, a clogged filter), or less: xi (1 + k).",
    signature="The line pressure sags more as its flow grows, and its ringing after the injection dies sooner.",
)

GUIDE_LEAKAGE = Effect(
    id="guide_leakage",
    component=Component.CLOSED_END,
    parameters=(parameter("c", 0.0, 5e-13, 5e-16, unit="m3/(s Pa)"),),
    apply=added("departures", "leakage"),
    sentence="Fuel leaks past the needle guide, open or shut: c (p_L - p_C) drains the line.",
    signature="The line pressure stands a little below the rail pressure all the time and its ringing dies sooner.",
    wear=True,
)

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
    relations=(Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.NEAR, Proof.BALLISTIC_RATE),),
    wear=True,
)

ORIFICE_CAVITATION = Effect(
    id="orifice_cavitation",
    component=Component.NOZZLE,
    parameters=(parameter("n_crit_excess", 0.0, 0.6, 0.02, (0.06, 0.12, 0.3)),),
    apply=added("departures", "critical_excess"),
    sentence="Spray holes cavitate: below N_crit the flow falls by sqrt(N/N_crit), N = (p_S - p_v)/(p_S - p_C).",
    signature="Less flow at high rail pressure only; below a rail pressure set by N_crit nothing changes.",
)

SEAT_AREA = Effect(
    id="seat_area",
    component=Component.SEAT,
    parameters=(parameter("v_S", -0.8, 1.5, 0.01),),
    apply=scaled("seat", "flow_coefficient"),
    sentence="The needle seat passes more fuel at the same lift, or less: Q_S (1 + v_S).",
    signature="Shows at opening and closing, while the seat throttles, and hardly at full lift.",
    relations=(Relation(("lift_dependent_seat_coefficient",), Likeness.ALIKE, Proof.BALLISTIC_RATE),),
    wear=True,
)


def _control_flow(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    flow, start, end = values
    if flow == 0.0:
        return model
    valve, flow = valve_of(model.injector), (model.injector.line.control_flow or 0.0) + flow
    times = {"control_start": valve.start + start, "control_end": valve.end + end}
    return model.with_changes("line", control_flow=flow, **times)


CONTROL_FLOW = Effect(
    id="control_flow",
    component=Component.CLOSED_END,
    parameters=(
        parameter("c", 0.0, 30.0, 0.05, (0.0, 4.0), unit="mm3/ms", si=MM3_PER_MS),
        parameter("d_on", -150.0, 150.0, 0.0, unit="us", si=MICROSECOND),
        parameter("d_off", -150.0, 150.0, 0.0, unit="us", si=MICROSECOND),
    ),
    apply=_control_flow,
    sentence=(
        "The pilot valve of a servo injector drains the line while it is open, from before the needle lifts to "
        "before it falls, by d_on and d_off more than the file says: c sqrt(p_L / 100 MPa) into the return."
    ),
    signature="The line pressure falls some tenths of a millisecond before the needle leaves its seat.",
    decided_by="the flow of the injector's return line",
)


SEAT_OUTFLOW = Effect(
    id="seat_outflow",
    component=Component.CLOSED_END,
    parameters=(),
    apply=lambda m, _: replace(m, injector=m.injector.model_copy(update={"line_outflow": LineOutflow.SEAT})),
    sentence="The line is drained by the flow through the seat, which also fills the sac, not by what is injected.",
    signature="The line pressure dips a few microseconds sooner at opening, by what fills the sac.",
)


def _lift_dependent_seat_coefficient(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (loss, lift), before = values, model.departures
    if before.seat_loss != 0.0:
        lift = before.seat_loss_lift  # the law has one scale of lift: that of the loss in force stays
    return model.with_changes("departures", seat_loss=before.seat_loss + loss, seat_loss_lift=lift)


LIFT_DEPENDENT_SEAT_COEFFICIENT = Effect(
    id="lift_dependent_seat_coefficient",
    component=Component.SEAT,
    parameters=(
        parameter("a", -0.8, 0.95, 0.01, (-0.2, -0.03, 0.03, 0.2)),
        replace(parameter("x_c", 10.0, 200.0, 0.0, (30.0, 90.0), "um", MICROMETRE), off=NO_DEPARTURES.seat_loss_lift),
    ),
    apply=_lift_dependent_seat_coefficient,
    sentence="The seat passes less (or more) at small lift than at full lift: alpha_S (1 - a exp(-x_N/x_c)).",
    signature="Shows in the first and last moments of an opening; ballistic injections lose most.",
)


def _chamber_pressure_rise(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (rise, share), before = values, model.departures
    at_once, with_seat = before.chamber_rise + (1.0 - share) * rise, before.chamber_rise_with_seat + share * rise
    return model.with_changes("departures", chamber_rise=at_once, chamber_rise_with_seat=with_seat)


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
