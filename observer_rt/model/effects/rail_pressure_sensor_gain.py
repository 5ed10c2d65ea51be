"""Rail-pressure sensor with a wrong scale."""

from collections.abc import Sequence

from observer_rt.model.effect import PRESSURE_GAUGE, Effect, Likeness, Place, Relation, parameter
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    terms, factor = model.inputs, 1.0 / (1.0 + values[0])
    return model.with_terms(
        "inputs", rail_factor=terms.rail_factor * factor, rail_shift=terms.rail_shift * factor
    )


EFFECT = Effect(
    id="rail_pressure_sensor_gain",
    place=Place.RAIL_SENSOR,
    parameters=(parameter("g", -0.1, 0.1, 2e-4),),
    apply=_apply,
    sentence="The rail pressure is recorded too high (or too low) by a factor: measured = true (1 + g).",
    signature=(
        "With the needle shut the line pressure differs from the recorded rail pressure by a share of it."
    ),
    relations=(
        Relation(
            ("rail_pressure_sensor_offset", "line_pressure_sensor_offset"), Likeness.NEAR, PRESSURE_GAUGE
        ),
    ),
)
