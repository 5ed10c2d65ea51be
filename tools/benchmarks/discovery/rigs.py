"""Real lines and injectors as they are measured, at operating points. Imports nothing of `observer_rt`."""

import itertools
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from tests.plants.arrays import Array
from tests.plants.histories import POINTS
from tests.plants.parameters import Faults
from tests.plants.plant import SAMPLE_RATE, Bench, Event, Needle, Outcome, Shot, Surroundings
from tests.plants.real import RealInjector, Setting, real_injector
from tools.benchmarks.discovery.discrepancies import Discrepancy, Plant, plant_of

GIVEN = POINTS
"""Operating points `discover` is given."""
FURTHER = tuple(itertools.product((80e6, 120e6), (0.9e-3, 1.5e-3)))
"""Operating points it never sees: there the gap is measured."""
RATE_NOISE = 0.5e-6  # m3/s per sample of a measured rate at 100 kHz
RATE_GAIN = 0.005  # one sigma of a recording's gain
FIT_INJECTIONS = 6  # in each recording
FIRST, DISTANCE = 40e-3, 50e-3  # s: start of the first injection, and from one to the next
NEEDLE_SPREAD = 0.15  # of a plant's speeds


@dataclass(frozen=True)
class Rig:
    """One plant and how it is measured, healthy and not: with a measured rate or without."""

    discrepancy: Discrepancy | Setting
    with_rate: bool
    seed: int

    @property
    def number(self) -> int:
        return [*type(self.discrepancy)].index(self.discrepancy)

    @property
    def plant(self) -> Plant | RealInjector:
        of = self.discrepancy
        return real_injector(of, self.seed) if isinstance(of, Setting) else plant_of(of, self.seed)

    @property
    def points(self) -> Sequence[tuple[float, float]]:
        """Operating points that `fit` and `discover` are given."""
        plant = self.plant
        return plant.points if isinstance(plant, RealInjector) else GIVEN

    @property
    def name(self) -> str:
        return f"{self.discrepancy}{'-with-rate' if self.with_rate else ''}-{self.seed}"


def healthy_benches(rig: Rig) -> tuple[Bench, ...]:
    rng = np.random.default_rng([rig.seed, rig.number, zlib.crc32(b"healthy")])
    return tuple(bench_of(rig, point, FIT_INJECTIONS, rng) for point in GIVEN)


def bench_of(rig: Rig, point: tuple[float, float], injections: int, rng: Generator, noise: float = 1.0) -> Bench:
    """One healthy recording at one operating point, its injections anywhere on the grid of samples."""
    plant, (rail_pressure, duration) = rig.plant, point
    if isinstance(plant, RealInjector):
        return replace(plant.bench([point] * injections, plant.faults, rng), noise=noise)
    shots = [Shot(rng.uniform(0.0, 1.0 / SAMPLE_RATE), duration) for _ in range(injections)]
    starts = tuple(FIRST + DISTANCE * number for number in range(injections))
    openings = [(start + shot.start, duration) for start, shot in zip(starts, shots, strict=True)]
    supply = plant.rail.supply(openings, rail_pressure, rng.random())
    around = Surroundings(starts=starts, supply=(supply,), before_noise=plant.mounting)
    events = tuple(Event(rail_pressure, (shot,), Faults()) for shot in shots)
    seed = int(rng.integers(2**62))
    return Bench(plant.part, needle_of(rig), events, noise=noise, seed=seed, line=plant.line, around=around)


def needle_of(rig: Rig) -> Needle:
    rng = np.random.default_rng([rig.seed, rig.number, zlib.crc32(b"needle")])
    opening, closing = 1.0 + NEEDLE_SPREAD * rng.uniform(-1.0, 1.0, 2)
    return Needle(0.80 * opening, 0.90 * closing)


def measured_rate(bench: Bench, outcome: Outcome) -> Array:
    """Rate an instrument measures [m3/s] (n,), with white noise and a gain error; true of a bench without noise."""
    rng = np.random.default_rng([bench.seed, 1])
    truth = outcome.truth.injection_rate
    gain = 1.0 + RATE_GAIN * bench.noise * rng.normal()
    return np.asarray(gain * truth + RATE_NOISE * bench.noise * rng.normal(size=truth.size), np.float64)
