"""Stiffness of the fuel in the line."""

from observer_rt.model.effect import FUEL_OR_DRAWING, Effect, Likeness, Place, Relation, parameter, scaled

EFFECT = Effect(
    id="bulk_modulus",
    place=Place.CLOSED_END,
    parameters=(parameter("r", -0.6, 1.0, 0.001, (-0.3, -0.12, 0.0, 0.15, 0.4)),),
    apply=scaled("fluid", "bulk_modulus_line"),
    sentence=(
        "The fuel in the line is stiffer, or softer, than the file says (another fuel, another "
        "temperature): K_L (1 + r)."
    ),
    signature="The line rings faster or slower at every rail pressure; the injected mass hardly changes.",
    relations=(Relation(("line_volume",), Likeness.SAME, FUEL_OR_DRAWING),),
)
