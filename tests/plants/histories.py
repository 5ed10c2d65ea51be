"""Histories of one injector whose every injection counts. Imports nothing of `observer_rt`."""

import itertools
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from tests.plants.laws import BY_DROP, BY_FLOW, BY_LIFT, BY_SPEED, BY_TIME, NINE_LAWS, NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import (
    LEAD,
    LIFT,
    Bench,
    Event,
    Shot,
    Surroundings,
    drawn_needle,
    event_start,
    seen_as,
    shots_in_turn,
)

MICROSECOND, MM3_PER_MS = 1e-6, 1e-6  # s, m3/s
POINTS = tuple(itertools.product((60e6, 100e6, 140e6), (0.6e-3, 1.9e-3)))
"""Operating points: rail pressure [Pa], needle open [s]."""
TAUGHT, NEW = (POINTS[0], POINTS[5]), (POINTS[1], POINTS[4])
"""Points at which each pressure and each duration is taught, and those that combine them otherwise."""
HEALTHY = Faults()
WEAR = (Faults(orifice_area=0.2), Faults(orifice_area=-0.15, seat_area=0.1))
GAPS = (0.1e-3, 0.2e-3, 0.3e-3, 0.45e-3, 0.6e-3)  # s, between shots
GROWS = "nozzle, growing to +24 %"
CYCLE = 60  # events of a driving cycle
CYCLE_PRESSURES, WANDER = (35e6, 175e6), (0.05, 0.3)  # Pa; of a sine between these, radians from event to event
MAINS, SMALL, APART = (0.3e-3, 2e-3), (0.2e-3, 0.4e-3), (0.4e-3, 1.2e-3)  # s: main, pilot or post, between them
PILOTS, POSTS = 0.7, 0.3  # share of the events that have one


@dataclass(frozen=True)
class Kind:
    """How an injector differs from its model; late [s]: its lift; before: events that are healthy, but for laws."""

    faults: Faults = HEALTHY
    laws: Laws = NO_LAWS
    late: float = 0.0
    before: int = 0


@dataclass(frozen=True)
class History:
    """Events of an injector, as recorded; count_from: the first that counts; fitted: laws for tier B's model."""

    kind: str
    point: str
    bench: Bench
    count_from: int = 0
    fitted: Laws = NO_LAWS

    @property
    def name(self) -> str:
        return f"{self.kind} {self.point}"


FIRST = {
    "nothing": Kind(),
    **{f"nozzle {100 * v:+.0f} %": Kind(Faults(orifice_area=v)) for v in (0.01, 0.03, 0.3, -0.1)},
    "seat -25 %": Kind(Faults(seat_area=-0.25)),
    "hole shuts by pressure": Kind(laws=Laws(shut_by_drop=0.3)),
    "coking 30 %": Kind(laws=Laws(coking=0.3)),
    "coking 10 %": Kind(laws=Laws(coking=0.1)),
    "chamber fills": Kind(laws=Laws(filling=5e9)),
    "nozzle by rail pressure": Kind(laws=Laws(rail_growth=0.3)),
    "seat dips at mid lift": Kind(laws=Laws(middle_loss=0.3)),
    "seat throttled at its stop": Kind(laws=Laws(stop_loss=0.5)),
    "seat laminar at small lift": Kind(Faults(seat_lift_loss=0.4)),
    "coking by root of time": Kind(laws=Laws(root_coking=0.22)),
    "seat chokes": Kind(laws=Laws(seat_choking=0.5)),
    "waves in the seat": Kind(laws=Laws(seat_waves=0.1)),
    "chamber swings": Kind(laws=Laws(chamber_ringing=8e6)),
    "seat hysteresis": Kind(laws=Laws(seat_hysteresis=0.6)),
    "holes covered at small lift": Kind(Faults(nozzle_lift_loss=0.6)),
    "friction x 2": Kind(Faults(line_friction=1.0)),
    "leak": Kind(Faults(guide_leakage=3e-14)),
    "offset .5 MPa": Kind(Faults(line_pressure_sensor_offset=0.5e6)),
    "lag 20 us": Kind(Faults(line_pressure_sensor_lag=20e-6)),
    "stiffness by pressure": Kind(Faults(bulk_modulus_slope=6.0)),
    "air": Kind(Faults(entrained_air=4e-3)),
    "nozzle +20 % and friction x 2": Kind(Faults(orifice_area=0.2, line_friction=1.0)),
    **{f"lift late {late} us": Kind(late=late * MICROSECOND) for late in (20, 40, 60)},
    "lift early 20 us": Kind(late=-20 * MICROSECOND),
    "line pressure late 20 us": Kind(Faults(channel_skew=20 * MICROSECOND)),
}
"""Kinds of which the first injection must be right."""


PRODUCTS = {
    **{f"nozzle by rail and time, {a:g}": Laws(nozzle_product=a) for a in (0.03, 0.05, 0.1, -0.1)},
    "nozzle by rail and lift": Laws(nozzle_product=0.2, second_factor=BY_LIFT),
    "seat by rail and lift": Laws(seat_product=0.2, second_factor=BY_LIFT),
    "seat by rail and time": Laws(seat_product=0.2),
    "nozzle by time and lift": Laws(nozzle_product=0.2, first_factor=BY_TIME, second_factor=BY_LIFT),
    "nozzle by drop and time": Laws(nozzle_product=0.1, first_factor=BY_DROP),
    "nozzle by drop and lift": Laws(nozzle_product=-0.15, first_factor=BY_DROP, second_factor=BY_LIFT),
    "nozzle by rail and flow": Laws(nozzle_product=0.1, second_factor=BY_FLOW),
    "nozzle by rail and speed": Laws(nozzle_product=0.3, second_factor=BY_SPEED),
    "seat by rail and speed": Laws(seat_product=0.3, second_factor=BY_SPEED),
    "seat by time and lift": Laws(seat_product=0.3, first_factor=BY_TIME, second_factor=BY_LIFT),
    "seat by drop and time": Laws(seat_product=-0.3, first_factor=BY_DROP),
    "nozzle and seat by rail and time": Laws(nozzle_product=0.07, seat_product=-0.2),
}
"""Laws of two quantities, which no sum of functions of one of them holds."""


DRIVEN = {name: FIRST[name] for name in ("coking 30 %", "seat -25 %", "friction x 2")} | {
    "healthy": Kind(),
    "nozzle +12 %": Kind(Faults(orifice_area=0.12)),
    GROWS: Kind(Faults(orifice_area=0.24)),
    "nozzle by rail and time": Kind(laws=PRODUCTS["nozzle by rail and time, 0.1"]),
}
"""Kinds that go through a driving cycle."""


def first_injections(seed: int) -> list[History]:
    """One injection of every kind at every point, a recording each."""
    return [
        History(name, at(*point), bench_of(kind, [point], seed, name, *point))
        for name, kind in FIRST.items()
        for point in POINTS
    ]


def combinations(seed: int) -> list[History]:
    """Taught at two points, whose pressures and durations are then combined otherwise, three times."""
    points = [*TAUGHT * 8, *NEW * 3]
    kinds = {name: Kind(laws=laws) for name, laws in PRODUCTS.items()} | {"nozzle +20 %": Kind(WEAR[0])}
    return [History(name, "", bench_of(kind, points, seed, name), 16) for name, kind in kinds.items()]


def jumps(seed: int) -> list[History]:
    """After two healthy passes over the points wear comes at once."""
    sizes = [sign * size for size in (0.03, 0.05, 0.08, 0.13, 0.2, 0.3, 0.43) for sign in (1, -1)]
    kinds = {f"nozzle {100 * size:+.0f} %": Kind(Faults(orifice_area=size), before=12) for size in sizes}
    kinds |= {f"seat {100 * size:+.0f} %": Kind(Faults(seat_area=size), before=12) for size in (0.25, -0.25)}
    return _chained(kinds, seed, 12)


def late_lifts(seed: int) -> list[History]:
    """After two healthy, or worn, passes over the points the lift is recorded late."""
    kinds = {f"late {late} us": Kind(late=late * MICROSECOND, before=12) for late in (20, 40, 60, -20)}
    return _chained(kinds, seed, 12)


def low_pressures(seed: int) -> list[History]:
    """Steady wear at one point of a low rail pressure, 16 injectors."""
    rng = np.random.default_rng([seed, 56])
    histories = []
    for number in range(16):
        point = (rng.uniform(56e6, 66e6), rng.uniform(0.7e-3, 2.2e-3))
        kind = Kind(Faults(orifice_area=rng.uniform(-0.4, 0.4), seat_area=rng.uniform(-0.25, 0.25)))
        histories.append(History("wear", f"{number} {at(*point)}", bench_of(kind, [point] * 16, seed, number)))
    return histories


def pilot_valves(seed: int) -> list[History]:
    """A pilot valve's flow beside wear; tier B's model is fitted to an injector without it, or with 4 mm3/ms."""
    histories = []
    for fitted, flows in ((0.0, (0.0, 2.0, 4.0, 6.0, 8.0)), (4.0, (2.0, 4.0, 6.0, 8.0))):
        for flow, faults in itertools.product(flows, WEAR):
            kind = Kind(faults, Laws(control_flow=flow * MM3_PER_MS))
            wear = f"nozzle {100 * faults.orifice_area:+.0f} %"
            bench = bench_of(kind, [*POINTS * 4], seed, fitted, flow, wear)
            name = f"{flow:g} mm3/ms, fitted with {fitted:g}"
            histories.append(History(name, wear, bench, fitted=Laws(control_flow=fitted * MM3_PER_MS)))
    return histories


def close_shots(seed: int) -> list[History]:
    """Pilot, main and post injection of worn injectors, closer and closer."""
    histories = []
    for gap, (number, faults) in itertools.product(GAPS, enumerate(WEAR)):
        rng, begins = _rng(seed, gap, number), (0.0, 0.4e-3 + gap, 1.4e-3 + 2.0 * gap)
        shots = tuple(Shot(begin, duration) for begin, duration in zip(begins, (0.4e-3, 1e-3, 0.4e-3), strict=True))
        events = tuple(Event(pressure, shots, faults) for pressure in (60e6, 100e6, 140e6) * 4)
        bench = Bench(Injector(), drawn_needle(rng), events, seed=int(rng.integers(2**62)))
        histories.append(History(f"gaps of {1e3 * gap:g} ms", str(number), bench))
    return histories


def driving_cycles(seed: int) -> list[History]:
    """Rail pressures that wander, every event of other durations, many with a pilot or a post injection."""
    histories = []
    for name, kind in DRIVEN.items():
        rng = _rng(seed, "drive", name)
        swings = np.sin(rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(rng.uniform(*WANDER, CYCLE)))
        pressures = np.interp(swings, (-1.0, 1.0), CYCLE_PRESSURES).tolist()
        wear = [kind.faults] * CYCLE
        if name == GROWS:
            wear = [Faults(orifice_area=size) for size in np.linspace(0.0, kind.faults.orifice_area, CYCLE).tolist()]
        events = tuple(Event(p, _driven_shots(rng), faults) for p, faults in zip(pressures, wear, strict=True))
        bench = Bench(Injector(), drawn_needle(rng), events, seed=int(rng.integers(2**62)), laws=kind.laws)
        histories.append(History(name, "", bench))
    return histories


def _driven_shots(rng: Generator) -> tuple[Shot, ...]:
    pilot, post = ([SMALL] if rng.random() < share else [] for share in (PILOTS, POSTS))
    durations = [rng.uniform(*limits) for limits in (*pilot, MAINS, *post)]
    return shots_in_turn(durations, rng.uniform(*APART, len(durations)).tolist(), rng.uniform(0.0, 1e-5))


SETS: dict[str, Callable[[int], list[History]]] = {
    "first": first_injections,
    "laws": lambda seed: _chained({name: Kind(faults, laws) for name, (laws, faults) in NINE_LAWS.items()}, seed),
    "products": lambda seed: _chained({name: Kind(laws=laws) for name, laws in PRODUCTS.items()}, seed),
    "combinations": combinations,
    "jumps": jumps,
    "late": late_lifts,
    "low": low_pressures,
    "pilot": pilot_valves,
    "shots": close_shots,
    "drive": driving_cycles,
}
"""Histories by a name, for a seed; where nothing else is said, four times over all points."""


def at(pressure: float, duration: float) -> str:
    return f"at {pressure / 1e6:.3g} MPa {1e3 * duration:.2g} ms"


def _chained(kinds: Mapping[str, Kind], seed: int, count_from: int = 0) -> list[History]:
    return [History(name, "", bench_of(kind, [*POINTS * 4], seed, name), count_from) for name, kind in kinds.items()]


def _rng(seed: int, *names: object) -> Generator:
    return np.random.default_rng([seed, zlib.crc32(" ".join(map(str, names)).encode())])


def bench_of(kind: Kind, points: Sequence[tuple[float, float]], seed: int, *names: object) -> Bench:
    """A bench of a kind with an injection at each of the points; seed and names determine all that is drawn."""
    rng = _rng(seed, *names)
    events = tuple(
        Event(pressure, (Shot(rng.uniform(0.0, 1e-5), duration),), kind.faults if i >= kind.before else HEALTHY)
        for i, (pressure, duration) in enumerate(points)
    )
    begins = event_start(kind.before) - LEAD
    late = seen_as(LIFT, lambda time, lift: np.interp(time - np.where(time > begins, kind.late, 0.0), time, lift))
    around = Surroundings(before_noise=(late,) if kind.late else ())
    return Bench(Injector(), drawn_needle(rng), events, seed=int(rng.integers(2**62)), around=around, laws=kind.laws)
