"""Effects in the sensors of line and rail pressure: offset, scale, lag, delay."""

from collections.abc import Sequence

from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND
from observer_rt.model.effect import (
    BOTH_CHANNELS,
    PRESSURE_GAUGE,
    Apparent,
    Component,
    Effect,
    Likeness,
    Relation,
    added,
    parameter,
)
from observer_rt.model.effective import EffectiveModel

CHANNEL_SKEW = Effect(
    id="channel_skew",
    component=Component.LINE_SENSOR,
    parameters=(parameter("d", -60.0, 60.0, 2.0, (-20.0, 0.0, 20.0), "us", MICROSECOND),),
    apply=added("sensor", "delay"),
    sentence=(
        "The line pressure is recorded late (or early) against rail pressure and lift by d: other "
        "filters, other clocks."
    ),
    signature="The whole line pressure is shifted in time; steep changes show it, their shape stays.",
    relations=(Relation(("line_pressure_sensor_lag",), Likeness.ALIKE, BOTH_CHANNELS),),
)

LINE_PRESSURE_SENSOR_LAG = Effect(
    id="line_pressure_sensor_lag",
    component=Component.LINE_SENSOR,
    parameters=(parameter("tau", 0.0, 500.0, 2.0, (0.0, 30.0, 120.0), "us", MICROSECOND),),
    apply=added("sensor", "lag"),
    sentence="The line-pressure sensor follows its pressure with a delay: tau y' = p_L - y.",
    signature=(
        "Steep changes of the line pressure are recorded late and rounded, at opening, closing and while "
        "it rings."
    ),
    apparent=Apparent.LEFT,
)

LINE_PRESSURE_SENSOR_OFFSET = Effect(
    id="line_pressure_sensor_offset",
    component=Component.LINE_SENSOR,
    parameters=(parameter("o", -10.0, 10.0, 0.02, unit="MPa", si=MEGAPASCAL),),
    apply=added("sensor", "offset"),
    sentence="The line pressure is recorded too high (or too low) by the same pressure always: y = p_L + o.",
    signature=(
        "With the needle shut the line pressure differs from the rail pressure by the same amount at "
        "every pressure."
    ),
    apparent=Apparent.SETTLED,
)


def _rail_pressure_sensor_gain(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    terms, factor = model.inputs, 1.0 / (1.0 + values[0])
    return model.with_terms(
        "inputs", rail_factor=terms.rail_factor * factor, rail_shift=terms.rail_shift * factor
    )


RAIL_PRESSURE_SENSOR_GAIN = Effect(
    id="rail_pressure_sensor_gain",
    component=Component.RAIL_SENSOR,
    parameters=(parameter("g", -0.1, 0.1, 2e-4),),
    apply=_rail_pressure_sensor_gain,
    sentence="The rail pressure is recorded too high (or too low) by a factor: measured = true (1 + g).",
    signature=(
        "With the needle shut the line pressure differs from the recorded rail pressure by a share of it."
    ),
    relations=(
        Relation(
            ("rail_pressure_sensor_offset", "line_pressure_sensor_offset"), Likeness.NEAR, PRESSURE_GAUGE
        ),
    ),
)


def _rail_pressure_sensor_offset(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    terms = model.inputs
    return model.with_terms("inputs", rail_shift=terms.rail_shift - values[0] * terms.rail_factor)


RAIL_PRESSURE_SENSOR_OFFSET = Effect(
    id="rail_pressure_sensor_offset",
    component=Component.RAIL_SENSOR,
    parameters=(parameter("o", -10.0, 10.0, 0.02, unit="MPa", si=MEGAPASCAL),),
    apply=_rail_pressure_sensor_offset,
    sentence=(
        "The rail pressure is recorded too high (or too low) by the same pressure always: measured = "
        "true + o."
    ),
    signature=(
        "With the needle shut the line pressure differs from the recorded rail pressure by the same "
        "amount at every pressure."
    ),
    relations=(Relation(("line_pressure_sensor_offset",), Likeness.NEAR, PRESSURE_GAUGE),),
)

RAIL_PRESSURE_SKEW = Effect(
    id="rail_pressure_skew",
    component=Component.RAIL_SENSOR,
    parameters=(parameter("d", -100.0, 100.0, 2.0, (-30.0, 0.0, 30.0), "us", MICROSECOND),),
    apply=added("inputs", "rail_delay"),
    sentence="The rail pressure is recorded late (or early) against lift and line pressure by d: other filters.",
    signature="The line pressure is off with every change of the rail pressure only; a rail at rest hides it.",
    relations=(Relation(("channel_skew",), Likeness.NEAR, BOTH_CHANNELS),),
    remedy="undo the delay of the rail-pressure channel, at its filter or in the bench file, as filter_delay_us",
)
