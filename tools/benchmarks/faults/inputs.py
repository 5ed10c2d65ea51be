"""Faults of the inputs: what a sensor, its cable or its settings make of a signal, after its noise."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from tests.plants.arrays import Array
from tests.plants.plant import LIFT, LINE, RAIL, SIGNALS, Measured
from tools.benchmarks.faults.scenario import Group, Kind, Placed

MPA, UM, US = 1e6, 1e-6, 1e-6
DRIFT = {RAIL: (0.5 * MPA, 4 * MPA), LINE: (0.5 * MPA, 4 * MPA), LIFT: (3 * UM, 30 * UM)}
SPIKE = {RAIL: 20 * MPA, LINE: 20 * MPA, LIFT: 40 * UM}
SPIKES = 400.0  # 1/s
LAGS = (30 * US, 300 * US)
TO_BAR, TO_MM = 10.0, 1e-3
CLIPPED = (0.6, 0.97)  # of the highest value

Wave = Callable[[Array, Array, str, Generator], Array]
"""What becomes of a signal (m,) while the fault lasts: of its times [s], values, role and chance."""

_SENSOR = frozenset({"CONTRADICTED", "MODEL_INADEQUATE", "PRESSURE_OFFSET", "NOT_LEARNED", "SUDDEN_CHANGE"})
_GONE = _SENSOR | {
    "INPUT_FROZEN",
    "INPUT_CLIPPED",
    "SAMPLES_LOST",
    "NEEDLE_STUCK",
    "LIFT_ZERO",
    "LIFT_DEAD",
    "NO_STANDSTILL",
}
_LATE = _SENSOR | {"TIME_BASE", "SENSOR_LAG", "LIFT_SENSOR_LAG", "REVISED", "AMBIGUOUS_SCALE"}


def _late(time: Array, values: Array, role: str, rng: Generator) -> Array:
    share = -np.expm1(-(time[1] - time[0]) / rng.uniform(*LAGS))
    start = [(1.0 - share) * values[0]]
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, zi=start)[0], np.float64)


def _drifting(time: Array, values: Array, role: str, rng: Generator) -> Array:
    size = rng.uniform(*DRIFT[role]) * (1.0 if rng.random() < 0.5 else -1.0)
    return np.asarray(values + size * np.bartlett(values.size), np.float64)


def _spikes(time: Array, values: Array, role: str, rng: Generator) -> Array:
    hit = rng.random(values.size) < SPIKES * (time[1] - time[0])
    return np.asarray(values + hit * SPIKE[role] * rng.choice((-1.0, 1.0), values.size), np.float64)


def _other_unit(time: Array, values: Array, role: str, rng: Generator) -> Array:
    factor = TO_MM if role == LIFT else TO_BAR
    return values * (factor if rng.random() < 0.5 else 1.0 / factor)


_WAVES: dict[str, tuple[Wave, frozenset[str]]] = {
    "dead": (lambda time, values, role, rng: np.zeros_like(values), _GONE),
    "unavailable": (lambda time, values, role, rng: np.full_like(values, np.nan), _GONE),
    "frozen": (lambda time, values, role, rng: np.full_like(values, values[0]), _GONE),
    "lag": (_late, _LATE),
    "drift": (_drifting, _GONE),
    "step": (
        lambda time, values, role, rng: values + rng.uniform(*DRIFT[role]) * rng.choice((-1.0, 1.0)),
        _GONE,
    ),
    "spikes": (_spikes, _GONE),
    "unit": (_other_unit, _GONE),
    "clipped": (
        lambda time, values, role, rng: np.minimum(values, rng.uniform(*CLIPPED) * np.max(values)),
        _GONE,
    ),
}
LATE = {
    "lag_needle": 0.1e-3
}  # s: where the lift does not show that the needle opens, the falling pressure must
_OF = {f"{name}_{role.split('_')[0]}": (role, *found) for name, found in _WAVES.items() for role in SIGNALS}
_SWAPPED = {"swapped_pressures": (RAIL, LINE)}
KINDS = tuple(
    Kind(name, Group.INPUT, true, LATE.get(name, 0.0)) for name, (_, _, true) in _OF.items()
) + tuple(Kind(name, Group.INPUT, _GONE) for name in _SWAPPED)


def with_input_fault(measured: Measured, placed: Placed) -> Measured:
    """The signals with a fault of an input."""
    during = (measured.time >= placed.begin) & (measured.time < placed.end)
    signals = {role: getattr(measured, role).copy() for role in SIGNALS}
    if placed.kind.name in _SWAPPED:
        one, other = _SWAPPED[placed.kind.name]
        signals[one][during], signals[other][during] = signals[other][during], signals[one][during]
    else:
        role, wave, _ = _OF[placed.kind.name]
        signals[role][during] = wave(measured.time[during], signals[role][during], role, placed.chance)
    return Measured(measured.time, **signals)
