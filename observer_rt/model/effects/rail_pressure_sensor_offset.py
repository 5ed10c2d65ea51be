"""Rail-pressure sensor with an offset."""

from collections.abc import Sequence

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effect import PRESSURE_GAUGE, Effect, Likeness, Place, Relation, parameter
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    terms = model.inputs
    return model.with_terms("inputs", rail_shift=terms.rail_shift - values[0] * terms.rail_factor)


EFFECT = Effect(
    id="rail_pressure_sensor_offset",
    place=Place.RAIL_SENSOR,
    parameters=(parameter("o", -10.0, 10.0, 0.02, unit="MPa", si=MEGAPASCAL),),
    apply=_apply,
    sentence=(
        "The rail pressure is recorded too high (or too low) by the same pressure always: measured = "
        "true + o."
    ),
    signature=(
        "With the needle shut the line pressure differs from the recorded rail pressure by the same "
        "amount at every pressure."
    ),
    relations=(Relation(("line_pressure_sensor_offset",), Likeness.NEAR, PRESSURE_GAUGE),),
)
