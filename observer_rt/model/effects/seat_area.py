"""Needle seat worn wider, or with deposits."""

from observer_rt.model.effect import BALLISTIC_RATE, Effect, Likeness, Place, Relation, parameter, scaled

EFFECT = Effect(
    id="seat_area",
    place=Place.SEAT,
    parameters=(parameter("v_S", -0.8, 1.5, 0.01),),
    apply=scaled("seat", "flow_coefficient"),
    sentence="The needle seat passes more fuel at the same lift, or less: Q_S (1 + v_S).",
    signature="Shows at opening and closing, while the seat throttles, and hardly at full lift.",
    relations=(Relation(("lift_dependent_seat_coefficient",), Likeness.ALIKE, BALLISTIC_RATE),),
    wear=True,
)
