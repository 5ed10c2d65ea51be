"""Leak past the needle guide."""

from observer_rt.model.effect import Apparent, Effect, Place, added, parameter

EFFECT = Effect(
    id="guide_leakage",
    place=Place.CLOSED_END,
    parameters=(parameter("c", 0.0, 5e-13, 5e-16, unit="m3/(s Pa)"),),
    apply=added("departures", "leakage"),
    sentence="Fuel leaks past the needle guide, open or shut: c (p_L - p_C) drains the line.",
    signature=(
        "The line pressure stands a little below the rail pressure all the time and its ringing dies sooner."
    ),
    apparent=Apparent.SETTLED,
    wear=True,
)
