"""Effects in the sensors of needle lift, line and rail pressure: offset, scale, lag, delay."""

from collections.abc import Sequence

from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND
from observer_rt.model.effect import Component, Effect, Likeness, Proof, Relation, added, parameter, scaled
from observer_rt.model.effective import EffectiveModel

_LIKE_ANOTHER_SEAT = (
    Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.ALIKE, Proof.LIFT_GAUGE_OR_RATE),
    Relation(("orifice_area",), Likeness.NEAR, Proof.LIFT_GAUGE_OR_RATE),
)
CHANNEL_SKEW = Effect(
    id="channel_skew",
    component=Component.LINE_SENSOR,
    parameters=(parameter("d", -60.0, 60.0, 2.0, (-20.0, 0.0, 20.0), "us", MICROSECOND),),
    apply=added("sensor", "delay"),
    sentence="The line pressure is recorded late (or early) by d against rail pressure and lift: another filter.",
    signature="The whole line pressure is shifted in time; steep changes show it, their shape stays.",
    relations=(Relation(("line_pressure_sensor_lag",), Likeness.ALIKE, Proof.BOTH_CHANNELS),),
)

LINE_PRESSURE_SENSOR_LAG = Effect(
    id="line_pressure_sensor_lag",
    component=Component.LINE_SENSOR,
    parameters=(parameter("tau", 0.0, 500.0, 2.0, (0.0, 30.0, 120.0), "us", MICROSECOND),),
    apply=added("sensor", "lag"),
    sentence="The line-pressure sensor follows its pressure with a delay: tau y' = p_L - y.",
    signature="Steep changes of the line pressure are recorded late and rounded: opening, closing and ringing.",
    apparent=True,
)

LINE_PRESSURE_SENSOR_OFFSET = Effect(
    id="line_pressure_sensor_offset",
    component=Component.LINE_SENSOR,
    parameters=(parameter("o", -10.0, 10.0, 0.02, unit="MPa", si=MEGAPASCAL),),
    apply=added("sensor", "offset"),
    sentence="The line pressure is recorded too high (or too low) by the same pressure always: y = p_L + o.",
    signature="With the needle shut the line pressure is off the rail pressure by the same amount at every pressure.",
)


LIFT_GAIN = Effect(
    id="lift_gain",
    component=Component.LIFT_SENSOR,
    parameters=(parameter("g", -0.3, 0.3, 0.003),),
    apply=scaled("inputs", "lift_factor"),
    sentence="The recorded lift is too small (or too large) by a factor: true = measured (1 + g).",
    signature="Like a wider (or narrower) seat: shows while the seat throttles, at small lift.",
    relations=(Relation(("lift_offset",), Likeness.ALIKE, Proof.LIFT_GAUGE), *_LIKE_ANOTHER_SEAT),
)

LIFT_OFFSET = Effect(
    id="lift_offset",
    component=Component.LIFT_SENSOR,
    parameters=(parameter("x_0", -60.0, 60.0, 0.2, unit="um", si=MICROMETRE),),
    apply=added("inputs", "lift_shift"),
    sentence="The open needle is higher than recorded by x_0 (sensor offset, a bent stem): measured = true - x_0.",
    signature="Opening and closing are off by x_0: above 0, flow begins before the recorded lift and ends after it.",
    relations=_LIKE_ANOTHER_SEAT,
)

NEEDLE_LIFT_SENSOR_LAG = Effect(
    id="needle_lift_sensor_lag",
    component=Component.LIFT_SENSOR,
    parameters=(parameter("tau", 0.0, 150.0, 2.0, (5.0, 20.0, 60.0), "us", MICROSECOND),),
    apply=added("inputs", "lift_lag"),
    sentence="The needle lift is recorded by a slow sensor or amplifier: tau y' = x_N - y.",
    signature="Opening and closing are recorded late and rounded, against both pressures.",
    relations=(
        Relation(("channel_skew", "lift_offset", "lift_dependent_seat_coefficient"), Likeness.NEAR, Proof.LIFT_STEP),
    ),
    remedy="state the lag of the lift sensor in the bench file, as lag_us of [signals.needle_lift]",
)


def _rail_pressure_sensor_gain(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    terms, factor = model.inputs, 1.0 / (1.0 + values[0])
    return model.with_changes("inputs", rail_factor=terms.rail_factor * factor, rail_shift=terms.rail_shift * factor)


RAIL_PRESSURE_SENSOR_GAIN = Effect(
    id="rail_pressure_sensor_gain",
    component=Component.RAIL_SENSOR,
    parameters=(parameter("g", -0.1, 0.1, 2e-4),),
    apply=_rail_pressure_sensor_gain,
    sentence="The rail pressure is recorded too high (or too low) by a factor: measured = true (1 + g).",
    signature="With the needle shut the line pressure differs from the recorded rail pressure by a share of it.",
    relations=(
        Relation(("rail_pressure_sensor_offset", "line_pressure_sensor_offset"), Likeness.NEAR, Proof.PRESSURE_GAUGE),
    ),
)


def _rail_pressure_sensor_offset(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    terms = model.inputs
    return model.with_changes("inputs", rail_shift=terms.rail_shift - values[0] * terms.rail_factor)


RAIL_PRESSURE_SENSOR_OFFSET = Effect(
    id="rail_pressure_sensor_offset",
    component=Component.RAIL_SENSOR,
    parameters=(parameter("o", -10.0, 10.0, 0.02, unit="MPa", si=MEGAPASCAL),),
    apply=_rail_pressure_sensor_offset,
    sentence="The rail pressure is recorded too high (or low) by the same pressure always: measured = true + o.",
    signature="With the needle shut the line pressure is off the recorded rail pressure by the same amount always.",
    relations=(Relation(("line_pressure_sensor_offset",), Likeness.NEAR, Proof.PRESSURE_GAUGE),),
)

RAIL_PRESSURE_SKEW = Effect(
    id="rail_pressure_skew",
    component=Component.RAIL_SENSOR,
    parameters=(parameter("d", -100.0, 100.0, 2.0, (-30.0, 0.0, 30.0), "us", MICROSECOND),),
    apply=added("inputs", "rail_delay"),
    sentence="The rail pressure is recorded late (or early) against lift and line pressure by d: other filters.",
    signature="The line pressure is off with every change of the rail pressure only; a rail at rest hides it.",
    relations=(Relation(("channel_skew",), Likeness.NEAR, Proof.BOTH_CHANNELS),),
    remedy="undo the delay of the rail-pressure channel, at its filter or in the bench file, as filter_delay_us",
)
