"""The line drained by the seat flow, as mass balance says."""

from collections.abc import Sequence
from dataclasses import replace

from observer_rt.model.effect import Effect, Place
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import LineOutflow


def _apply(model: EffectiveModel, _: Sequence[float]) -> EffectiveModel:
    injector = model.injector.model_copy(update={"line_outflow": LineOutflow.SEAT})
    return replace(model, injector=injector)


EFFECT = Effect(
    id="seat_outflow",
    place=Place.CLOSED_END,
    parameters=(),
    apply=_apply,
    sentence=(
        "The line is drained by the flow through the seat, which also fills the sac, not by the "
        "injection rate."
    ),
    signature="The line pressure dips a few microseconds sooner at opening, by what fills the sac.",
)
