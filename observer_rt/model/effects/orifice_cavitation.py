"""Spray holes that cavitate."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (excess,) = values
    return model.with_departures(critical_excess=model.departures.critical_excess + excess)


EFFECT = Effect(
    id="orifice_cavitation",
    effect_class=EffectClass.DYNAMICS,
    place=Place.NOZZLE,
    equation=Equation.LINE_PRESSURE,
    parameters=(
        EffectParameter(
            "n_crit_excess",
            "-",
            1.0,
            off=0.0,
            lowest=0.0,
            highest=0.6,
            dead_zone=0.02,
            starts=(0.06, 0.12, 0.3),
        ),
    ),
    sentence=(
        "The spray holes cavitate at high pressure: below N_crit their coefficient falls by "
        "sqrt(N/N_crit), N = (p_S - p_v)/(p_S - p_C)."
    ),
    signature="Less flow at high rail pressure only; below a rail pressure set by N_crit nothing changes.",
    apply=_apply,
)
