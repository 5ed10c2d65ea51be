"""Reproducible random cases: a class of faults, a master seed and a number give one bench."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.random import Generator

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Shot, drawn_needle, shots_in_turn, wave_injector

EVENTS = 20
RAIL_PRESSURES = (40e6, 160e6)  # Pa
OPENING_DURATIONS = (0.3e-3, 3.0e-3)  # s
PILOT_DURATIONS = (0.3e-3, 0.6e-3)  # s
MAIN_DURATIONS = (0.5e-3, 3.0e-3)  # s
SHOT_GAPS = (0.35e-3, 1.2e-3)  # s, from closing to the next opening
PILOT_SHARE, POST_SHARE = 1 / 3, 0.2  # of all cases; of those with a pilot
VARYING_SHARE = 0.5  # of the cases: a new operating point every event


class Group(StrEnum):
    """The demand on a class: the bars differ."""

    MAIN = "main"  # estimated well
    MIXED = "mixed"  # estimated, or not valid
    LOOK_ALIKE = "look-alike"  # never wrong while valid
    WAVE = "wave"  # never valid
    CHANGE = "change"  # followed
    OPERATION = "operation"  # estimated well, whatever the bench does
    RATE = "rate"  # estimated, less well
    STABILITY = "stability"  # never wrong while valid, never diverging


@dataclass(frozen=True)
class Case:
    class_name: str
    master_seed: int
    number: int
    bench: Bench
    change_event: int | None = None  # number (from 0) of the first event after a sudden change


Draw = Callable[[Generator], Faults]


def sign(rng: Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


_SIZES: dict[str, Draw] = {
    "orifice_area": lambda rng: Faults(orifice_area=rng.uniform(-0.5, 0.5)),
    "seat_area": lambda rng: Faults(seat_area=rng.uniform(-0.4, 0.4)),
    "guide_leakage": lambda rng: Faults(guide_leakage=3e-14),
    "chamber_pressure_rise": lambda rng: Faults(chamber_pressure_rise=8e6),
    "orifice_cavitation": lambda rng: Faults(orifice_cavitation=0.12),
    "line_friction": lambda rng: Faults(line_friction=2.0),
    "line_pressure_sensor_offset": lambda rng: Faults(line_pressure_sensor_offset=0.8e6 * sign(rng)),
    "line_pressure_sensor_lag": lambda rng: Faults(line_pressure_sensor_lag=40e-6),
    "bulk_modulus": lambda rng: Faults(bulk_modulus=0.2 * sign(rng)),
    "entrained_air": lambda rng: Faults(entrained_air=4e-3),
}
"""The faults that must be estimated well, at the sizes of the bars."""

_MORE_SIZES: dict[str, Draw] = {
    "rail_pressure_sensor_offset": lambda rng: Faults(rail_pressure_sensor_offset=3e6 * sign(rng)),
    "rail_pressure_sensor_gain": lambda rng: Faults(rail_pressure_sensor_gain=0.02 * sign(rng)),
}

_LOOK_ALIKES: dict[str, Draw] = {
    "lift_offset": lambda rng: Faults(lift_offset=rng.uniform(5e-6, 20e-6) * sign(rng)),
    "lift_gain": lambda rng: Faults(lift_gain=rng.uniform(0.05, 0.2) * sign(rng)),
    "channel_skew": lambda rng: Faults(channel_skew=rng.uniform(10e-6, 40e-6)),
    "lift_dependent_seat": lambda rng: Faults(
        seat_lift_loss=rng.uniform(0.2, 0.6), seat_lift_scale=rng.uniform(20e-6, 80e-6)
    ),
    "seat_outflow": lambda rng: Faults(seat_outflow=1.0),
}

_INVENTED: dict[str, Draw] = {
    "lift_dependent_nozzle": lambda rng: Faults(
        nozzle_lift_loss=rng.uniform(0.1, 0.4), seat_lift_scale=rng.uniform(20e-6, 80e-6)
    ),
    "lift_sensor_lag": lambda rng: Faults(lift_sensor_lag=rng.uniform(10e-6, 40e-6)),
    "line_pressure_sensor_gain": lambda rng: Faults(line_pressure_sensor_gain=rng.uniform(0.01, 0.03) * sign(rng)),
    "line_inertance": lambda rng: Faults(line_inertance=rng.uniform(0.1, 0.3) * sign(rng)),
    "sac_stiffness": lambda rng: Faults(sac_stiffness=rng.uniform(0.2, 0.5) * sign(rng)),
}
"""Outside the vocabulary."""

_REST: dict[str, Draw] = {
    "line_volume": lambda rng: Faults(line_volume=0.2 * sign(rng)),
    "pressure_dependent_bulk_modulus": lambda rng: Faults(bulk_modulus_slope=rng.uniform(-4.0, 8.0)),
}
"""What the vocabulary has beside the classes of the bars."""

_UNSEEN: dict[str, Draw] = {"fuel_density": lambda rng: Faults(fuel_density=rng.uniform(0.02, 0.06) * sign(rng))}
"""In the vocabulary, but nothing in the pressures tells it: flows and 1/inertance scale together. Shown by itself."""

_VOCABULARY = _SIZES | _MORE_SIZES | _LOOK_ALIKES | _REST


def combined(first: Faults, second: Faults) -> Faults:
    """Both faults at once; the second wins where both set the same parameter."""
    healthy = Faults()
    changed = {name: value for name, value in second._asdict().items() if value != getattr(healthy, name)}
    return first._replace(**changed)


def _two_of(draws: dict[str, Draw]) -> Draw:
    names = sorted(draws)

    def draw(rng: Generator) -> Faults:
        first, second = rng.choice(len(names), 2, replace=False)
        return combined(draws[names[first]](rng), draws[names[second]](rng))

    return draw


def _one_of(draws: dict[str, Draw]) -> Draw:
    names = sorted(draws)
    return lambda rng: draws[names[rng.integers(len(names))]](rng)


def _wear(rng: Generator) -> Faults:
    return combined(_SIZES["orifice_area"](rng), _SIZES["seat_area"](rng))


@dataclass(frozen=True)
class FaultClass:
    """A class of cases: its faults, and what else is particular."""

    group: Group
    faults: Draw
    sample_rate: float = 100e3  # Hz
    waves: bool = False
    jumps: bool = False  # healthy first, the faults appear at one event
    grows: float = 0.0  # share of the faults' size that comes only event by event
    missing: int = 0  # periods without an injection, among the others
    windowed: bool = False  # only what lies round the injections is recorded


_JUMPS: dict[str, Draw] = {
    "jump_nozzle": lambda rng: Faults(orifice_area=rng.uniform(0.1, 0.5) * sign(rng)),
    "jump_friction": _SIZES["line_friction"],
    "jump_offset": _SIZES["line_pressure_sensor_offset"],
}

CLASSES: dict[str, FaultClass] = {
    "healthy": FaultClass(Group.MAIN, lambda _: Faults()),
    "orifice_and_seat_area": FaultClass(Group.MAIN, _wear),
    **{name: FaultClass(Group.MAIN, draw) for name, draw in _SIZES.items()},
    **{name: FaultClass(Group.MIXED, draw) for name, draw in _MORE_SIZES.items()},
    "mixture": FaultClass(Group.MIXED, _two_of(_SIZES | _MORE_SIZES)),
    **{name: FaultClass(Group.LOOK_ALIKE, draw) for name, draw in (_LOOK_ALIKES | _INVENTED | _UNSEEN).items()},
    "wave_healthy": FaultClass(Group.WAVE, lambda _: Faults(), waves=True),
    "wave_worn": FaultClass(Group.WAVE, _wear, waves=True),
    **{name: FaultClass(Group.CHANGE, draw, jumps=True) for name, draw in _JUMPS.items()},
    "growing_wear": FaultClass(Group.CHANGE, _wear, grows=0.1),
    "missing_injections": FaultClass(Group.OPERATION, _wear, missing=3),
    "windowed": FaultClass(Group.OPERATION, _one_of(_SIZES), windowed=True),
    "at_50_khz": FaultClass(Group.RATE, _one_of(_SIZES), sample_rate=50e3),
    "at_20_khz": FaultClass(Group.RATE, _one_of(_SIZES), sample_rate=20e3),
    "stability": FaultClass(Group.STABILITY, _two_of(_VOCABULARY)),
    "stability_beyond": FaultClass(Group.STABILITY, _two_of(_VOCABULARY | _INVENTED | _UNSEEN)),
}


def make_case(class_name: str, master_seed: int, number: int) -> Case:
    """The case with this number. Raises KeyError for an unknown class."""
    fault_class = CLASSES[class_name]
    rng = np.random.default_rng([master_seed, zlib.crc32(class_name.encode()), number])
    seed = int(rng.integers(2**62))
    needle = drawn_needle(rng)
    schedule = drawn_events(rng, varying=rng.random() < VARYING_SHARE or fault_class.group is Group.STABILITY)
    faults = fault_class.faults(rng)
    change_event = int(rng.integers(6, 14)) if fault_class.jumps else None
    noise = float(2.0 ** rng.uniform(-1.0, 1.0)) if fault_class.group is Group.STABILITY else 1.0
    events = tuple(
        replace(event, faults=_faults_at(i, faults, change_event, fault_class.grows))
        for i, event in enumerate(schedule)
    )
    for _ in range(fault_class.missing):
        position = int(rng.integers(1, 10))
        events = (*events[:position], replace(events[position], shots=()), *events[position:])
    injector = wave_injector(rng.uniform(2e-9, 4e-9)) if fault_class.waves else Injector()
    bench = Bench(injector, needle, events, fault_class.sample_rate, noise, seed)
    return Case(class_name, master_seed, number, bench, change_event)


def _faults_at(event: int, faults: Faults, change_event: int | None, grows: float) -> Faults:
    if change_event is not None and event < change_event:
        return Faults()
    if grows > 0.0:
        size = 1.0 - grows * (1.0 - (event + 1) / EVENTS)
        return Faults(*(new + size * (old - new) for new, old in zip(Faults(), faults, strict=True)))
    return faults


def worn_events(rng: Generator, wear: float) -> tuple[Event, ...]:
    events = drawn_events(rng, varying=rng.random() < 0.5)
    return tuple(replace(event, faults=Faults(orifice_area=wear)) for event in events)


def drawn_events(rng: Generator, varying: bool) -> tuple[Event, ...]:
    """Events of one case: one operating point, or a new one every time."""
    pilot = rng.random() < PILOT_SHARE
    post = pilot and rng.random() < POST_SHARE
    rail, shots = rng.uniform(*RAIL_PRESSURES), _shots(rng, pilot, post)
    events = []
    for _ in range(EVENTS):
        if varying:
            rail, shots = rng.uniform(*RAIL_PRESSURES), _shots(rng, pilot, post)
        phase = rng.uniform(0.0, 50e-6)  # on the grid of samples, down to 20 kHz
        events.append(Event(rail, tuple(replace(s, start=s.start + phase) for s in shots), Faults()))
    return tuple(events)


def _shots(rng: Generator, pilot: bool, post: bool) -> tuple[Shot, ...]:
    if not pilot:
        return (Shot(0.0, rng.uniform(*OPENING_DURATIONS)),)
    durations = [rng.uniform(*PILOT_DURATIONS), rng.uniform(*MAIN_DURATIONS)]
    if post:
        durations.append(rng.uniform(*PILOT_DURATIONS))
    return shots_in_turn(durations, rng.uniform(*SHOT_GAPS, len(durations)).tolist())
