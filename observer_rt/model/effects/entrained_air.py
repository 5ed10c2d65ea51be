"""Air in the fuel of the line."""

from observer_rt.model.effect import Effect, Place, added, parameter

EFFECT = Effect(
    id="entrained_air",
    place=Place.CLOSED_END,
    parameters=(parameter("g", 0.0, 0.03, 3e-5, (0.0, 2e-3, 6e-3, 0.015)),),
    apply=added("departures", "air"),
    sentence="Air in the fuel makes the line softer, most at low pressure: 1/K_eff = 1/K + g/p.",
    signature="The line rings slower, the more so the lower the rail pressure.",
)
