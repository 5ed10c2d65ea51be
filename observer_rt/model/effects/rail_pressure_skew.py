"""Rail pressure recorded late, or early."""

from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effect import BOTH_CHANNELS, Effect, Likeness, Place, Relation, added, parameter

EFFECT = Effect(
    id="rail_pressure_skew",
    place=Place.RAIL_SENSOR,
    parameters=(parameter("d", -100.0, 100.0, 2.0, (-30.0, 0.0, 30.0), "us", MICROSECOND),),
    apply=added("inputs", "rail_delay"),
    sentence="The rail pressure is recorded late (or early) against lift and line pressure by d: other filters.",
    signature="The line pressure is off with every change of the rail pressure only; a rail at rest hides it.",
    relations=(Relation(("channel_skew",), Likeness.NEAR, BOTH_CHANNELS),),
    remedy="undo the delay of the rail-pressure channel, at its filter or in the bench file, as filter_delay_us",
)
