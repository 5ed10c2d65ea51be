"""What a bench could measure to tell effects apart that these recordings cannot."""

from collections.abc import Iterable
from itertools import combinations

from observer_rt.discovery.search.result import Decisive
from observer_rt.model.effect import Effect, Place
from observer_rt.model.effects import VOCABULARY

_PRESSURE_SENSORS = frozenset({Place.RAIL_SENSOR, Place.LINE_SENSOR})


def decide_by(ids: Iterable[str]) -> tuple[Decisive, ...]:
    """For every two of the effects, the measurement that would tell them apart."""
    found: dict[str, list[str]] = {}
    for pair in combinations(dict.fromkeys(ids), 2):
        together = found.setdefault(_measurement(*(VOCABULARY[one] for one in pair)), [])
        together.extend(one for one in pair if one not in together)
    return tuple(Decisive(measurement, tuple(ids)) for measurement, ids in found.items())


def _measurement(one: Effect, other: Effect) -> str:
    """What the effects themselves say decides, else what decides by their places."""
    relation, places = one.relation_to(other), {one.place, other.place}
    said = relation.decided_by if relation is not None else one.decided_by or other.decided_by
    if said:
        return said
    if places & _PRESSURE_SENSORS:
        return "the pressure sensors against a reference gauge, and recordings at more rail pressures"
    if Place.CHAMBER in places or Place.NOZZLE in places:
        return "recordings at more rail pressures and at another chamber pressure, with the injection rate measured"
    return "recordings at more rail pressures and durations, with the injection rate measured"
