"""What a bench could measure to tell effects apart that these recordings cannot."""

from collections.abc import Iterable
from itertools import combinations

from observer_rt.discovery.search.result import Decisive
from observer_rt.model.deciding import WITH_A_MEASURED_RATE
from observer_rt.model.effect import Effect, Place
from observer_rt.model.effects import VOCABULARY

_PRESSURE_SENSORS = frozenset({Place.RAIL_SENSOR, Place.LINE_SENSOR})


def decide_by(ids: Iterable[str], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """For every two of the effects, the measurement that would tell them apart.

    rate_measured: the injection rate is among what could not tell them.
    """
    found: dict[str, list[str]] = {}
    for pair in combinations(dict.fromkeys(ids), 2):
        one, other = (VOCABULARY[each] for each in pair)
        together = found.setdefault(_measurement(one, other, rate_measured), [])
        together.extend(each for each in pair if each not in together)
    return tuple(Decisive(measurement, tuple(ids)) for measurement, ids in found.items())


def _measurement(one: Effect, other: Effect, rate_measured: bool) -> str:
    """What the effects themselves say decides, else what decides by their places."""
    relation, places = one.relation_to(other), {one.place, other.place}
    said = relation.decided_by if relation is not None else one.decided_by or other.decided_by
    if said:
        return WITH_A_MEASURED_RATE.get(said, said) if rate_measured else said
    if places & _PRESSURE_SENSORS:
        return "the pressure sensors against a reference gauge, and recordings at more rail pressures"
    at_chamber = Place.CHAMBER in places or Place.NOZZLE in places
    more = "rail pressures and at another chamber pressure" if at_chamber else "rail pressures and durations"
    with_rate = "" if rate_measured else ", with the injection rate measured"
    return f"recordings at more {more}{with_rate}"
