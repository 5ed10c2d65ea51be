"""Slow needle-lift sensor."""

from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effect import LIFT_STEP, Effect, Likeness, Place, Relation, added, parameter

EFFECT = Effect(
    id="needle_lift_sensor_lag",
    place=Place.LIFT_SENSOR,
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
