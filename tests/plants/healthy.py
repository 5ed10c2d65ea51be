"""Six healthy recordings of an injector on the richer plant, for `fit`. Imports nothing of `observer_rt`."""

import zlib
from itertools import product

import numpy as np

from tests.plants.parameters import Faults
from tests.plants.plant import SAMPLE_RATE, Bench, Event, Needle, Shot
from tests.plants.wave import LINES, Variant, real_part

FIT_PRESSURES = (60e6, 100e6, 140e6)  # Pa
FIT_DURATIONS = (0.6e-3, 1.9e-3)  # s, of the openings
FIT_EVENTS = 6  # in a recording of 0.52 s
START_SPREAD = 50e-6  # s, of an event on the grid of samples


def healthy_benches(
    variant: Variant, seed: int, sample_rate: float = SAMPLE_RATE, averaged: bool = False
) -> dict[str, Bench]:
    """By name, of the injector that a master seed has, on a line of this kind."""
    rng = np.random.default_rng([seed, zlib.crc32(b"healthy")])
    part, line, benches = real_part(seed), LINES[variant], {}
    for pressure, duration in product(FIT_PRESSURES, FIT_DURATIONS):
        starts = rng.uniform(0.0, START_SPREAD, FIT_EVENTS)
        events = tuple(Event(pressure, (Shot(s, duration),), Faults()) for s in starts)
        name = f"{1e-6 * pressure:03.0f}MPa_{1e3 * duration:.1f}ms"
        noise = int(rng.integers(2**62))
        benches[name] = Bench(part, Needle(), events, sample_rate, seed=noise, averaged=averaged, line=line)
    return benches
