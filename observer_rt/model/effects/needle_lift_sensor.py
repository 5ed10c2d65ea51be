"""Effects in the sensor of the needle lift: offset, scale, lag."""

from collections.abc import Sequence

from observer_rt.foundation.units import MICROMETRE, MICROSECOND
from observer_rt.model.effect import (
    LIFT_GAUGE,
    LIFT_GAUGE_OR_RATE,
    LIFT_STEP,
    Component,
    Effect,
    Likeness,
    Relation,
    added,
    parameter,
)
from observer_rt.model.effective import EffectiveModel


def _lift_gain(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    return model.with_terms("inputs", lift_factor=model.inputs.lift_factor * (1.0 + values[0]))


LIFT_GAIN = Effect(
    id="lift_gain",
    component=Component.LIFT_SENSOR,
    parameters=(parameter("g", -0.3, 0.3, 0.003),),
    apply=_lift_gain,
    sentence="The recorded lift is too small (or too large) by a factor: true = measured (1 + g).",
    signature="Like a wider (or narrower) seat: shows while the seat throttles, at small lift.",
    relations=(
        Relation(("lift_offset",), Likeness.ALIKE, LIFT_GAUGE),
        Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.ALIKE, LIFT_GAUGE_OR_RATE),
        Relation(("orifice_area",), Likeness.NEAR, LIFT_GAUGE_OR_RATE),
    ),
)

LIFT_OFFSET = Effect(
    id="lift_offset",
    component=Component.LIFT_SENSOR,
    parameters=(parameter("x_0", -60.0, 60.0, 0.2, unit="um", si=MICROMETRE),),
    apply=added("inputs", "lift_shift"),
    sentence=(
        "The needle is higher than recorded by x_0 while it is open (sensor offset, a bent stem): "
        "measured = true - x_0."
    ),
    signature=(
        "Opening and closing are off by x_0 of lift: for x_0 > 0 flow begins before the recorded lift "
        "does and ends after it."
    ),
    relations=(
        Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.ALIKE, LIFT_GAUGE_OR_RATE),
        Relation(("orifice_area",), Likeness.NEAR, LIFT_GAUGE_OR_RATE),
    ),
)

NEEDLE_LIFT_SENSOR_LAG = Effect(
    id="needle_lift_sensor_lag",
    component=Component.LIFT_SENSOR,
    parameters=(parameter("tau", 0.0, 150.0, 2.0, (5.0, 20.0, 60.0), "us", MICROSECOND),),
    apply=added("inputs", "lift_lag"),
    sentence="The needle lift is recorded by a slow sensor or amplifier: tau y' = x_N - y.",
    signature="Opening and closing are recorded late and rounded, against both pressures.",
    relations=(
        Relation(
            ("channel_skew", "lift_offset", "lift_dependent_seat_coefficient"), Likeness.NEAR, LIFT_STEP
        ),
    ),
    remedy="state the lag of the lift sensor in the bench file, as lag_us of [signals.needle_lift]",
)
