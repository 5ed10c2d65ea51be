"""Fuel that stiffens with pressure."""

from observer_rt.model.effect import Effect, Place, added, parameter

EFFECT = Effect(
    id="pressure_dependent_bulk_modulus",
    place=Place.CLOSED_END,
    parameters=(parameter("n", -8.0, 12.0, 0.01, (-3.0, 0.0, 3.0, 8.0)),),
    apply=added("departures", "stiffness_slope"),
    sentence="The fuel in the line stiffens with its pressure: K = K_0 + n (p - 100 MPa).",
    signature="The line rings slower below 100 MPa and faster above.",
)
