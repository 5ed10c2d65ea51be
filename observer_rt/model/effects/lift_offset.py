"""Needle-lift sensor with an offset."""

from observer_rt.foundation.units import MICROMETRE
from observer_rt.model.effect import LIFT_GAUGE_OR_RATE, Effect, Likeness, Place, Relation, added, parameter

EFFECT = Effect(
    id="lift_offset",
    place=Place.LIFT_SENSOR,
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
