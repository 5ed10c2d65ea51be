"""Feed line with deposits, or a clogged filter."""

from collections.abc import Sequence

from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (change,) = values
    return model.with_section("line", loss_factor=1.0 + change)


EFFECT = Effect(
    id="line_friction",
    effect_class=EffectClass.DYNAMICS,
    place=Place.LINE_FLOW,
    equation=Equation.LINE_FLOW,
    parameters=(
        EffectParameter(
            "k", "-", 1.0, off=0.0, lowest=-0.95, highest=10.0, dead_zone=0.005, starts=(0.0, 2.0)
        ),
    ),
    sentence=(
        "The feed line loses more pressure to its flow (deposits, a clogged filter), or less: xi (1 + k)."
    ),
    signature=(
        "The line pressure sags more as the flow through the line grows, and its ringing after "
        "the injection dies sooner."
    ),
    apply=_apply,
)
