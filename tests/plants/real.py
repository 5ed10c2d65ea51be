"""Realistic injectors of three sizes, each with less and less left out of a real bench.

Fuel by pressure, two-pole filters and 14 bits, a pilot valve, an orifice; then control chamber, cavitating holes, a
wall that remembers, a room in the body, pump strokes, true drawings. Imports nothing of `observer_rt`.
"""

import itertools
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.random import Generator
from scipy.signal import butter, lfilter, lfilter_zi

from tests.plants import plant
from tests.plants.arrays import Array
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.rail import MovingRail, drawn_rail
from tests.plants.wave import WaveLine, real_part

CORNER = 28e3  # Hz, of the two-pole filter of a channel
BITS = {plant.RAIL: 250e6 / 2**14, plant.LINE: 250e6 / 2**14, plant.LIFT: 1e-3 / 2**14}  # Pa, Pa, m: of a converter
STIFFENING = 10.8  # K_1 of a diesel fuel
CONSTANT_AT = 100e6  # Pa, at which a fuel of one stiffness has that of one that stiffens
CAVITATING = 0.1  # N_crit - 1 of the holes
GAIN, OFFSET = 0.007, 0.1e6  # one sigma of a pressure sensor: share, Pa
DIAMETER, LENGTH, DENSITY = 0.01, 0.005, 0.005  # one sigma by which line and fuel are not as the drawing has them
NEEDLE_SPREAD = 0.15  # of its speeds
ELEMENTS = 8  # of the line


class Setting(StrEnum):
    """How real an injector is: each has what those before it have; the last three are whole, in three sizes."""

    CONSTANT = "constant fuel"
    FUEL = "fuel"
    FILTERS = "and filters"
    SERVO = "and servo flow"
    ORIFICE = "and orifice"
    CAR = "car"
    HEAVY_DUTY = "heavy duty"
    MARINE = "marine"


WHOLE = (Setting.CAR, Setting.HEAVY_DUTY, Setting.MARINE)


@dataclass(frozen=True)
class Size:
    """An injector as its maker draws it, the orifice behind the rail, its pilot valve, and how it is run: SI."""

    part: Injector
    body: float  # m3, in front of the seat
    orifice: float  # Pa s2/m6
    pilot: float  # m3/s at 100 MPa; also that of a valve with a chamber, while the needle rests
    durations: tuple[float, float]
    pressures: tuple[float, float, float]


def _drawn(
    length: float, bore: float, body: float, seat: tuple[float, float], holes: tuple[int, float], sac: float
) -> Injector:
    """Of a line's length and bore, the body's volume, diameter and lift of the seat, number and diameter of holes."""
    area, (diameter, lift), (number, hole) = math.pi / 4.0 * bore**2, seat, holes
    return Injector(
        density=815.0,
        bulk_modulus_line=1.2e9,
        bulk_modulus_sac=1.2e9,
        line_length=length,
        line_area=area,
        line_volume=area * length + body,
        seat_diameter=diameter,
        max_lift=lift,
        nozzle_area=0.78 * number * math.pi / 4.0 * hole**2,
        sac_volume=sac,
        drained_by_seat=1,
        stiffening=STIFFENING,
    )


CAR = Size(
    _drawn(0.19, 2.4e-3, 0.36e-6, (1.8e-3, 0.23e-3), (8, 0.115e-3), 0.4e-9),
    0.36e-6, 2e14, 4e-6, (0.6e-3, 1.6e-3), (60e6, 100e6, 150e6),
)  # fmt: skip
SIZES = {
    Setting.HEAVY_DUTY: Size(
        _drawn(0.32, 3.0e-3, 0.9e-6, (2.4e-3, 0.30e-3), (8, 0.19e-3), 1.2e-9),
        0.9e-6, 4e13, 8e-6, (0.9e-3, 2.4e-3), (60e6, 110e6, 170e6),
    ),
    Setting.MARINE: Size(
        _drawn(0.60, 5.0e-3, 5e-6, (5.0e-3, 0.50e-3), (9, 0.30e-3), 6e-9),
        5e-6, 6e12, 20e-6, (1.6e-3, 4e-3), (50e6, 90e6, 140e6),
    ),
}  # fmt: skip
"""Where a setting has none: `CAR`."""


@dataclass(frozen=True)
class RealInjector:
    """An injector on its bench; faults: what its sensors and its holes are like when it is healthy."""

    size: Size
    part: Injector
    line: WaveLine
    needle: plant.Needle
    laws: Laws
    faults: Faults
    rail: MovingRail
    steps: tuple[plant.Step, ...]

    @property
    def points(self) -> list[tuple[float, float]]:
        """Operating points that `fit` is given: rail pressure [Pa], needle open [s]."""
        return [*itertools.product(self.size.pressures, self.size.durations)]

    def bench(self, points: Sequence[tuple[float, float]], faults: Faults, rng: Generator) -> plant.Bench:
        """A recording with an injection at each of the points; faults: its own among them."""
        shots = [plant.Shot(rng.uniform(0.0, 1.0 / plant.SAMPLE_RATE), duration) for _, duration in points]
        events = tuple(plant.Event(point[0], (shot,), faults) for point, shot in zip(points, shots, strict=True))
        openings = [(plant.event_start(number) + shot.start, shot.duration) for number, shot in enumerate(shots)]
        supply = self.rail.supply(openings, float(np.mean([pressure for pressure, _ in points])), rng.random())
        around = plant.Surroundings(supply=(supply,), after_noise=self.steps)
        seed = int(rng.integers(2**62))
        return plant.Bench(self.part, self.needle, events, seed=seed, line=self.line, around=around, laws=self.laws)


def real_injector(setting: Setting, seed: int) -> RealInjector:
    """The injector of a setting and a seed, from which all else of it is drawn."""
    rng = np.random.default_rng([seed, zlib.crc32(setting.encode())])
    size, has = SIZES.get(setting, CAR), [*Setting][: [*Setting].index(setting) + 1]
    part = _as_made(real_part(int(rng.integers(2**62)), size.part), size.body, rng)
    opening, closing = 1.0 + NEEDLE_SPREAD * rng.uniform(-1.0, 1.0, 2)
    gains = GAIN * rng.normal(size=2)
    injector = RealInjector(
        size,
        part,
        WaveLine(end_share=size.body / part.line_volume, elements=ELEMENTS),
        plant.Needle(0.8 * opening, 0.9 * closing),
        Laws(control_flow=size.pilot) if Setting.SERVO in has else NO_LAWS,
        Faults(rail_pressure_sensor_gain=gains[0], line_pressure_sensor_gain=gains[1]),
        drawn_rail(rng),
        tuple(map(_channel, BITS)) if Setting.FILTERS in has else (),
    )
    if setting is Setting.CONSTANT:
        stiffness = part.bulk_modulus_line + STIFFENING * CONSTANT_AT
        return replace(
            injector, part=part._replace(bulk_modulus_line=stiffness, bulk_modulus_sac=stiffness, stiffening=0.0)
        )
    if Setting.ORIFICE in has:
        injector = replace(injector, line=injector.line._replace(inlet_loss=size.orifice))
    if setting in WHOLE:
        line = injector.line._replace(damping=0.5, viscosity=4e-6, smooth_flow=size.part.nozzle_area * 500.0)
        offset = OFFSET * rng.normal()
        faults = injector.faults._replace(orifice_cavitation=CAVITATING, line_pressure_sensor_offset=offset)
        laws = Laws(control_flow=1.6 * size.pilot, chamber_inlet=1.28 * size.pilot, guide_area=1.2 * size.pilot)
        injector = replace(injector, line=line, faults=faults, laws=laws)
    return injector


def _as_made(part: Injector, body: float, rng: Generator) -> Injector:
    """The part with line and fuel unlike the drawing, the body's room [m3] as there."""
    diameter, length, density = 1.0 + np.array([DIAMETER, LENGTH, DENSITY]) * rng.normal(size=3)
    pipe = (part.line_volume - body) * diameter**2 * length
    return part._replace(
        density=part.density * density,
        line_length=part.line_length * length,
        line_area=part.line_area * diameter**2,
        line_volume=pipe + body,
    )


def _channel(role: str) -> plant.Step:
    """A channel's filter and its converter."""
    poles = butter(2, CORNER, fs=plant.SAMPLE_RATE)

    def change(_: Array, values: Array) -> Array:
        filtered, _state = lfilter(*poles, values, zi=lfilter_zi(*poles) * values[0])
        return np.asarray(np.rint(filtered / BITS[role]) * BITS[role], np.float64)

    return plant.seen_as(role, change)
