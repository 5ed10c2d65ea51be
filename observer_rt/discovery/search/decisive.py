"""What a bench could measure to tell effects apart that these recordings cannot."""

from collections.abc import Iterable
from itertools import combinations

from observer_rt.discovery.result import Decisive
from observer_rt.model.effect import Place
from observer_rt.model.effects import VOCABULARY

_LIFT = frozenset({"lift_offset", "lift_gain"})
_SEAT = frozenset({"seat_area", "lift_dependent_seat_coefficient", "orifice_area"})
_LATE = frozenset({"line_pressure_sensor_lag", "channel_skew"})
_PRESSURE_SENSORS = frozenset({Place.RAIL_SENSOR, Place.LINE_SENSOR})
_OFFSETS = frozenset(
    {"line_pressure_sensor_offset", "rail_pressure_sensor_offset", "rail_pressure_sensor_gain"}
)


def decide_by(ids: Iterable[str]) -> tuple[Decisive, ...]:
    """For every two of the effects, the measurement that would tell them apart."""
    found: dict[str, list[str]] = {}
    for pair in combinations(dict.fromkeys(ids), 2):
        together = found.setdefault(_measurement(frozenset(pair)), [])
        together.extend(one for one in pair if one not in together)
    return tuple(Decisive(measurement, tuple(ids)) for measurement, ids in found.items())


def _measurement(pair: frozenset[str]) -> str:
    places = {VOCABULARY[one].place for one in pair}
    if pair <= {"bulk_modulus", "line_volume"}:
        return "a fuel sample (bulk modulus), or the volume of the line by its drawing: no signal tells them apart"
    if pair <= _LATE:
        return "one signal fed to both pressure channels: a skew shifts it, a lag rounds it; or a higher sample rate"
    if pair <= _OFFSETS:
        return "standstill at several rail pressures, and both sensors vented (0 MPa) or against a reference gauge"
    if pair & _LIFT and pair & _SEAT:
        return "the lift sensor against a gauge, at the stop and just off the seat; or the injection rate measured"
    if pair <= _LIFT:
        return "the lift sensor against a gauge, at the stop and just off the seat"
    if pair <= _SEAT:
        return "the injection rate measured, with ballistic injections among them"
    if "fuel_density" in pair:
        return "the density of a fuel sample, or the injected mass on a balance"
    if places & _PRESSURE_SENSORS:
        return "the pressure sensors against a reference gauge, and recordings at more rail pressures"
    if Place.CHAMBER in places or Place.NOZZLE in places:
        return "recordings at more rail pressures and at another chamber pressure, with the injection rate measured"
    return "recordings at more rail pressures and durations, with the injection rate measured"
