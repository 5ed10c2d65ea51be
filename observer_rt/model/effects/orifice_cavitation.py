"""Spray holes that cavitate."""

from observer_rt.model.effect import Effect, Place, added, parameter

EFFECT = Effect(
    id="orifice_cavitation",
    place=Place.NOZZLE,
    parameters=(parameter("n_crit_excess", 0.0, 0.6, 0.02, (0.06, 0.12, 0.3)),),
    apply=added("departures", "critical_excess"),
    sentence=(
        "The spray holes cavitate at high pressure: below N_crit their coefficient falls by "
        "sqrt(N/N_crit), N = (p_S - p_v)/(p_S - p_C)."
    ),
    signature="Less flow at high rail pressure only; below a rail pressure set by N_crit nothing changes.",
)
