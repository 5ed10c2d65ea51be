"""Spray holes worn wider by cavitation erosion, or narrowed by coking."""

from observer_rt.model.effect import BALLISTIC_RATE, Effect, Likeness, Place, Relation, parameter, scaled

EFFECT = Effect(
    id="orifice_area",
    place=Place.NOZZLE,
    parameters=(parameter("v_H", -0.8, 1.5, 0.003),),
    apply=scaled("nozzle", "flow_coefficient"),
    sentence=("The spray holes pass more fuel than the new ones (erosion), or less (coking): Q_H (1 + v_H)."),
    signature=(
        "While the needle is open the line pressure sags by more (or less), in proportion to the flow, "
        "at every rail pressure; nothing changes while it is shut."
    ),
    relations=(Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.NEAR, BALLISTIC_RATE),),
    wear=True,
)
