"""Range and resolution that a role has on the bus, by the signals of its samples."""

from typing import NamedTuple

import numpy as np

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import FLOAT32, FLOAT64, decode_signals, encode_signals
from observer_rt.foundation.units import Structs

_FLOAT_TYPES = {FLOAT32: np.float32, FLOAT64: np.float64}


class RoleRange(NamedTuple):
    """Lowest and highest value [SI] that every sample of a role's message can carry."""

    lowest: float
    highest: float


def message_of(bus: BusMap, role: Role) -> int:
    """Number of the input message that carries a role."""
    return next(n for n in range(len(bus.inputs.messages)) if _groups(bus, n, role))


def role_factor(bus: BusMap, role: Role) -> float:
    """Factor from the unit of the role in the database to SI."""
    (first, *_) = _groups(bus, message_of(bus, role), role)
    return float(first["factor"][ROLES.index(role)])


def role_range(bus: BusMap, role: Role) -> RoleRange:
    """Range [SI] of the role on the bus: the values that reach the receiver when more is encoded than fits."""
    length, factor = int(bus.inputs.messages[message_of(bus, role)]["length"]), role_factor(bus, role)
    lowest, highest = (
        [_received(value, signal, length) * factor for signal in _samples(bus, role)] for value in (-np.inf, np.inf)
    )
    return RoleRange(max(lowest), min(highest))


def _received(value: float, signal: Structs, length: int) -> float:
    """A value in the database's unit as received; signal: its table; length of the frame [bytes]."""
    payload, decoded = np.zeros(length, np.uint8), np.empty(1)
    encode_signals(np.array([value]), signal, payload)
    decode_signals(payload, signal, decoded)
    return float(decoded[0])


def role_resolution(bus: BusMap, role: Role, value: float) -> float:
    """Distance of two neighbouring values [SI] on the bus, near `value` [SI]; the coarsest of the samples."""
    factor = role_factor(bus, role)
    return max(_step(signal[0], value / factor) for signal in _samples(bus, role)) * factor if factor else np.inf


def _groups(bus: BusMap, number: int, role: Role) -> list[np.void]:
    message = bus.inputs.messages[number]
    first = int(message["first_group"])
    groups = bus.inputs.groups[first : first + int(message["group_count"])]
    roles = bus.inputs.streams["roles"]
    return [group for group in groups if int(roles[group["stream"]]) >> ROLES.index(role) & 1]


def _samples(bus: BusMap, role: Role) -> list[Structs]:
    """Tables of one signal each, of all samples of a role."""
    tables = []
    for group in _groups(bus, message_of(bus, role), role):
        first = int(group["first_signal"]) + int(group["position"][ROLES.index(role)])
        tables += [bus.inputs.signals[n : n + 1] for n in range(first, first + int(group["samples"]))]
    return tables


def _step(signal: np.void, value: float) -> float:
    scale = abs(float(signal["scale"]))
    kind = int(signal["kind"])
    if kind not in _FLOAT_TYPES:
        return scale
    raw = np.clip((value - float(signal["offset"])) / float(signal["scale"]), signal["lowest"], signal["highest"])
    with np.errstate(over="ignore"):  # nothing lies beyond the largest number
        return scale * abs(float(np.spacing(np.asarray(raw, _FLOAT_TYPES[kind]))))
