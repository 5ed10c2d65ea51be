"""Density of the fuel."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (change,) = values
    return model.with_section("fluid", density_line=1.0 + change, density_nozzle=1.0 + change)


EFFECT = Effect(
    id="fuel_density",
    effect_class=EffectClass.DYNAMICS,
    place=Place.LINE_FLOW,
    equation=Equation.LINE_FLOW,
    parameters=(
        EffectParameter(
            "r", "-", 1.0, off=0.0, lowest=-0.2, highest=0.2, dead_zone=0.001, starts=(-0.1, 0.0, 0.1)
        ),
    ),
    sentence="The fuel is denser, or lighter, than the file says, in line and nozzle: rho (1 + r).",
    signature=(
        "All flows change as one over the root of the density, and the line rings slower the "
        "denser the fuel is."
    ),
    apply=_apply,
)
