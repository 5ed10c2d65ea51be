"""Fuel that stiffens with pressure."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (slope,) = values
    return model.with_departures(stiffness_slope=model.departures.stiffness_slope + slope)


EFFECT = Effect(
    id="pressure_dependent_bulk_modulus",
    effect_class=EffectClass.DYNAMICS,
    place=Place.CLOSED_END,
    equation=Equation.LINE_PRESSURE,
    parameters=(
        EffectParameter(
            "n", "-", 1.0, off=0.0, lowest=-8.0, highest=12.0, dead_zone=0.01, starts=(-3.0, 0.0, 3.0, 8.0)
        ),
    ),
    sentence="The fuel in the line stiffens with its pressure: K = K_0 + n (p - 100 MPa).",
    signature="The line rings slower below 100 MPa and faster above.",
    apply=_apply,
)
