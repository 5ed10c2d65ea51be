"""Density of the fuel."""

from observer_rt.model.effect import FUEL_DENSITY, Effect, Place, parameter, scaled

EFFECT = Effect(
    id="fuel_density",
    place=Place.LINE_FLOW,
    parameters=(parameter("r", -0.2, 0.2, 0.001, (-0.1, 0.0, 0.1)),),
    apply=scaled("fluid", "density_line", "density_nozzle"),
    sentence="The fuel is denser, or lighter, than the file says, in line and nozzle: rho (1 + r).",
    signature=(
        "All flows change as one over the root of the density, and the line rings slower the denser the "
        "fuel is."
    ),
    decided_by=FUEL_DENSITY,
)
