"""Chamber pressure that rises while injecting."""

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effect import Effect, Place, added, parameter

EFFECT = Effect(
    id="chamber_pressure_rise",
    place=Place.CHAMBER,
    parameters=(parameter("dp", 0.0, 40.0, 0.2, unit="MPa", si=MEGAPASCAL),),
    apply=added("departures", "chamber_rise"),
    sentence="The pressure behind the nozzle rises by dp while the needle is open.",
    signature="Less flow while the needle is open, by a share that grows towards low rail pressure.",
)
