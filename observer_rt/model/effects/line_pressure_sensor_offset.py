"""Line-pressure sensor with an offset."""

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effect import Apparent, Effect, Place, added, parameter

EFFECT = Effect(
    id="line_pressure_sensor_offset",
    place=Place.LINE_SENSOR,
    parameters=(parameter("o", -10.0, 10.0, 0.02, unit="MPa", si=MEGAPASCAL),),
    apply=added("sensor", "offset"),
    sentence="The line pressure is recorded too high (or too low) by the same pressure always: y = p_L + o.",
    signature=(
        "With the needle shut the line pressure differs from the rail pressure by the same amount at "
        "every pressure."
    ),
    apparent=Apparent.SETTLED,
)
