"""Measurements that would decide between explanations which the recordings leave open."""

from collections.abc import Iterable, Sequence
from itertools import combinations

from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.identification.discovery.search.results import Decisive
from observer_rt.model.effect import WITH_A_MEASURED_RATE, Component, Effect
from observer_rt.model.effects import VOCABULARY

_PRESSURE_SENSORS = frozenset({Component.RAIL_SENSOR, Component.LINE_SENSOR})
_BESIDE_SHUT_NEEDLE = {Component.SEAT, Component.LIFT_SENSOR, Component.CLOSED_END}
"""Places at which fuel may leave, or seem to, while the needle is shut."""


def decide_by(ids: Iterable[str], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """The measurement that would tell any two effects apart. rate_measured: one of the rate already does not."""
    pairs = combinations((VOCABULARY[name] for name in dict.fromkeys(ids)), 2)
    return _by_measurement((_measurement(*pair, rate_measured), (pair[0].id, pair[1].id)) for pair in pairs)


def decide_between(proposals: Sequence[Proposal], rate_measured: bool = False) -> tuple[Decisive, ...]:
    """Measurements that would tell the first proposal from every other one; rate_measured: as of `decide_by`."""
    decisions = []
    for number, other in enumerate(proposals[1:], start=2):
        ours, theirs = (first.candidate.hypothesis.effects for first in (proposals[0], other))
        first = next((effect for effect in ours if effect not in theirs), ours[0])
        instead = next((effect for effect in theirs if effect not in ours), theirs[0])
        decisions.append((_measurement(first, instead, rate_measured), ("proposal 1", f"proposal {number}")))
    return _by_measurement(decisions)


def _by_measurement(decisions: Iterable[tuple[str, tuple[str, str]]]) -> tuple[Decisive, ...]:
    """Every measurement once, with all names that it tells apart."""
    separated: dict[str, dict[str, None]] = {}
    for measurement, names in decisions:
        separated.setdefault(measurement, {}).update(dict.fromkeys(names))
    return tuple(Decisive(measurement, tuple(names)) for measurement, names in separated.items())


def _measurement(first: Effect, second: Effect, rate_measured: bool) -> str:
    """The measurement that the effects state, else one that fits the places where they sit."""
    relation, places = first.relation_to(second), {first.component, second.component}
    stated = relation.decided_by if relation is not None else first.decided_by or second.decided_by
    if stated:
        return WITH_A_MEASURED_RATE.get(stated, stated) if rate_measured else stated
    if places <= _BESIDE_SHUT_NEEDLE and len(places) > 1 and not rate_measured:
        return "the injection rate or mass measured, or a recording with the needle shut for a second"
    if places & _PRESSURE_SENSORS:
        return "the pressure sensors against a reference gauge, and recordings at more rail pressures"
    at_chamber = Component.CHAMBER in places or Component.NOZZLE in places
    more = "rail pressures and at another chamber pressure" if at_chamber else "rail pressures and durations"
    with_rate = "" if rate_measured else ", with the injection rate measured"
    return f"recordings at more {more}{with_rate}"
