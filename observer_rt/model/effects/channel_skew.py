"""Line pressure recorded late, or early."""

from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effect import BOTH_CHANNELS, Effect, Likeness, Place, Relation, added, parameter

EFFECT = Effect(
    id="channel_skew",
    place=Place.LINE_SENSOR,
    parameters=(parameter("d", -60.0, 60.0, 2.0, (-20.0, 0.0, 20.0), "us", MICROSECOND),),
    apply=added("sensor", "delay"),
    sentence=(
        "The line pressure is recorded late (or early) against rail pressure and lift by d: other "
        "filters, other clocks."
    ),
    signature="The whole line pressure is shifted in time; steep changes show it, their shape stays.",
    relations=(Relation(("line_pressure_sensor_lag",), Likeness.ALIKE, BOTH_CHANNELS),),
)
