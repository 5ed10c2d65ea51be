"""Volume of the line."""

from observer_rt.model.effect import Effect, Place, parameter, scaled

EFFECT = Effect(
    id="line_volume",
    place=Place.CLOSED_END,
    parameters=(parameter("r", -0.5, 1.5, 0.001, (-0.3, -0.13, 0.0, 0.14, 0.43)),),
    apply=scaled("line", "volume"),
    sentence="The line holds more fuel, or less, than the file says: V_L (1 + r).",
    signature="The line rings slower or faster at every rail pressure; the injected mass hardly changes.",
)
