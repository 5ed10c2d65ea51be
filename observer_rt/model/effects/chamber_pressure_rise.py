"""Chamber pressure that rises while injecting."""

from collections.abc import Sequence

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effect import Effect, Place, parameter
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    rise, share = values
    before = model.departures
    return model.with_terms(
        "departures",
        chamber_rise=before.chamber_rise + (1.0 - share) * rise,
        chamber_rise_with_seat=before.chamber_rise_with_seat + share * rise,
    )


EFFECT = Effect(
    id="chamber_pressure_rise",
    place=Place.CHAMBER,
    parameters=(
        parameter("dp", 0.0, 40.0, 0.2, (2.0,), unit="MPa", si=MEGAPASCAL),
        parameter("s", 0.0, 1.0, 0.0, (0.0, 1.0)),
    ),
    apply=_apply,
    sentence=(
        "The pressure behind the nozzle rises with the needle, by dp at full lift: a share s of it in proportion to "
        "the seat's area, the rest at once."
    ),
    signature="Less flow while the needle is open, by a share that grows towards low rail pressure.",
)
