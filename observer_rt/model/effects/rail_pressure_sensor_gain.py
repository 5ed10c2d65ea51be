"""Rail-pressure sensor with a wrong scale."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (gain,) = values
    terms, factor = model.inputs, 1.0 / (1.0 + gain)
    return model.with_inputs(rail_factor=terms.rail_factor * factor, rail_shift=terms.rail_shift * factor)


EFFECT = Effect(
    id="rail_pressure_sensor_gain",
    effect_class=EffectClass.INPUT,
    place=Place.RAIL_SENSOR,
    equation=Equation.INPUT,
    parameters=(
        EffectParameter("g", "-", 1.0, off=0.0, lowest=-0.1, highest=0.1, dead_zone=2e-4, starts=(0.0,)),
    ),
    sentence="The rail pressure is recorded too high (or too low) by a factor: measured = true (1 + g).",
    signature=(
        "With the needle shut the line pressure differs from the recorded rail pressure by a share of it."
    ),
    apply=_apply,
)
