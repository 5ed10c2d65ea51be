"""Chamber pressure that rises while injecting."""

from collections.abc import Sequence

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effect import Effect, EffectClass, EffectParameter, Equation, Place
from observer_rt.model.effective import EffectiveModel


def _apply(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    (rise,) = values
    return model.with_departures(chamber_rise=model.departures.chamber_rise + rise)


EFFECT = Effect(
    id="chamber_pressure_rise",
    effect_class=EffectClass.INPUT,
    place=Place.CHAMBER,
    equation=Equation.INPUT,
    parameters=(
        EffectParameter(
            "dp",
            "MPa",
            MEGAPASCAL,
            off=0.0,
            lowest=0.0,
            highest=40 * MEGAPASCAL,
            dead_zone=0.2 * MEGAPASCAL,
            starts=(0.0,),
        ),
    ),
    sentence="The pressure behind the nozzle rises by dp while the needle is open.",
    signature="Less flow while the needle is open, by a share that grows towards low rail pressure.",
    apply=_apply,
)
