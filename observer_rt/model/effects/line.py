"""Effects in the fuel, the line and its leak: what drains, stores and brakes the fuel."""

from collections.abc import Sequence
from dataclasses import replace

from observer_rt.foundation.units import MICROSECOND, MM3_PER_MS
from observer_rt.model.effect import (
    FUEL_OR_DRAWING,
    SAMPLE_OR_BALANCE,
    Apparent,
    Component,
    Effect,
    Likeness,
    Relation,
    added,
    parameter,
    scaled,
)
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.hydraulics import valve_of
from observer_rt.model.parameters import LineOutflow

BULK_MODULUS = Effect(
    id="bulk_modulus",
    component=Component.CLOSED_END,
    parameters=(parameter("r", -0.6, 1.0, 0.001, (-0.3, -0.12, 0.0, 0.15, 0.4)),),
    apply=scaled("fluid", "bulk_modulus_line"),
    sentence=(
        "The fuel in the line is stiffer, or softer, than the file says (another fuel, another "
        "temperature): K_L (1 + r)."
    ),
    signature="The line rings faster or slower at every rail pressure; the injected mass hardly changes.",
    relations=(Relation(("line_volume",), Likeness.SAME, FUEL_OR_DRAWING),),
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
    signature=(
        "All flows change as one over the root of the density, and the line rings slower the denser the "
        "fuel is."
    ),
    decided_by=SAMPLE_OR_BALANCE,
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
    sentence=(
        "The feed line loses more pressure to its flow (deposits, a clogged filter), or less: xi (1 + k)."
    ),
    signature=(
        "The line pressure sags more as the flow through the line grows, and its ringing after the "
        "injection dies sooner."
    ),
)

GUIDE_LEAKAGE = Effect(
    id="guide_leakage",
    component=Component.CLOSED_END,
    parameters=(parameter("c", 0.0, 5e-13, 5e-16, unit="m3/(s Pa)"),),
    apply=added("departures", "leakage"),
    sentence="Fuel leaks past the needle guide, open or shut: c (p_L - p_C) drains the line.",
    signature=(
        "The line pressure stands a little below the rail pressure all the time and its ringing dies sooner."
    ),
    apparent=Apparent.SETTLED,
    wear=True,
)


def _control_flow(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    line, (flow, earlier, sooner) = model.injector.line, values
    if flow != 0.0:
        valve = valve_of(model.injector)
        changed = {"control_start": valve.start + earlier, "control_end": valve.end + sooner}
        line = line.model_copy(update={"control_flow": (line.control_flow or 0.0) + flow, **changed})
    return replace(model, injector=model.injector.model_copy(update={"line": line}))


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


def _seat_outflow(model: EffectiveModel, _: Sequence[float]) -> EffectiveModel:
    injector = model.injector.model_copy(update={"line_outflow": LineOutflow.SEAT})
    return replace(model, injector=injector)


SEAT_OUTFLOW = Effect(
    id="seat_outflow",
    component=Component.CLOSED_END,
    parameters=(),
    apply=_seat_outflow,
    sentence=(
        "The line is drained by the flow through the seat, which also fills the sac, not by the "
        "injection rate."
    ),
    signature="The line pressure dips a few microseconds sooner at opening, by what fills the sac.",
)
