"""Histories of one injector, of whose injections every one counts: the first, and those that nothing has taught.

Imports nothing of `observer_rt`.
"""

import zlib
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import LIFT, Bench, Event, Shot, Surroundings, drawn_needle, seen_as
from tools.benchmarks.discovery.rigs import GIVEN

MICROSECOND = 1e-6  # s
HEALTHY = Faults()


@dataclass(frozen=True)
class Kind:
    """How an injector differs from its model; late: by how much its lift is recorded late [s]."""

    faults: Faults = HEALTHY
    laws: Laws = NO_LAWS
    late: float = 0.0


@dataclass(frozen=True)
class History:
    """Events of an injector of some kind, at a point or several, as they are recorded on the nominal line."""

    kind: str
    point: str
    bench: Bench

    @property
    def name(self) -> str:
        """One of its own."""
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


def first_injections(seed: int) -> list[History]:
    """One injection of every kind at every point, a recording each."""
    return [
        History(name, f"at {pressure / 1e6:g} MPa {1e3 * duration:g} ms", recorded(kind, [(pressure, duration)], rng))
        for name, kind in FIRST.items()
        for pressure, duration in GIVEN
        for rng in [np.random.default_rng([seed, zlib.crc32(f"{name} {pressure} {duration}".encode())])]
    ]


SETS = {"first": first_injections}
"""Histories by the name of what they ask, for a seed."""


def recorded(kind: Kind, points: list[tuple[float, float]], rng: Generator) -> Bench:
    """A bench of a kind with an injection at each of the points: rail pressure [Pa], needle open [s]."""
    events = tuple(Event(p, (Shot(rng.uniform(0.0, 1e-5), duration),), kind.faults) for p, duration in points)
    late = seen_as(LIFT, lambda time, lift: np.interp(time - kind.late, time, lift))
    around = Surroundings(before_noise=(late,) if kind.late else ())
    return Bench(Injector(), drawn_needle(rng), events, seed=int(rng.integers(2**62)), around=around, laws=kind.laws)
