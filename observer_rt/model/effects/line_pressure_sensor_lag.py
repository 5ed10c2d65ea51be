"""Slow line-pressure sensor."""

from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effect import Apparent, Effect, Place, added, parameter

EFFECT = Effect(
    id="line_pressure_sensor_lag",
    place=Place.LINE_SENSOR,
    parameters=(parameter("tau", 0.0, 500.0, 2.0, (0.0, 30.0, 120.0), "us", MICROSECOND),),
    apply=added("sensor", "lag"),
    sentence="The line-pressure sensor follows its pressure with a delay: tau y' = p_L - y.",
    signature=(
        "Steep changes of the line pressure are recorded late and rounded, at opening, closing and while "
        "it rings."
    ),
    apparent=Apparent.LEFT,
)
