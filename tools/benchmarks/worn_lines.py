"""Steady wear on lines unlike the model, whose model is fitted to healthy recordings.

A line of a wrong length is fitted with weighed masses, because the level of the flow rests on the length.
"""

import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.observed_plants import bench_at
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot
from tools.benchmarks.campaign import Row
from tools.benchmarks.cases import Case
from tools.benchmarks.discovery.discrepancies import Discrepancy, plant_of
from tools.benchmarks.discovery.rigs import Rig, healthy_benches, needle_of
from tools.benchmarks.fitting import fitted_model, write_recordings
from tools.benchmarks.needles import How, score_by

CASES = 9  # of a discrepancy
EVENTS = 20
RAIL_PRESSURES, DURATIONS = (50e6, 150e6), (0.7e-3, 2.2e-3)  # Pa, s
NOZZLE, SEAT = 0.4, 0.25  # largest wear, of either sign
WEIGHED_SIGMA = 0.003  # of a mean mass


def worn_case(discrepancy: Discrepancy, seed: int, number: int) -> Case:
    """A case with constant wear; odd numbers have another operating point at each event, even ones a single point."""
    rng = np.random.default_rng([seed, [*Discrepancy].index(discrepancy), number, zlib.crc32(b"worn")])
    faults = Faults(orifice_area=rng.uniform(-NOZZLE, NOZZLE), seat_area=rng.uniform(-SEAT, SEAT))
    points = [(rng.uniform(*RAIL_PRESSURES), rng.uniform(*DURATIONS)) for _ in range(EVENTS)]
    points = points if number % 2 else [points[0]] * EVENTS
    events = tuple(Event(p, (Shot(rng.uniform(0.0, 1e-5), d),), faults) for p, d in points)
    bench = on_line(Bench(Injector(), Needle(), events, seed=int(rng.integers(2**62))), discrepancy, seed)
    return Case(discrepancy, seed, number, bench)


def on_line(bench: Bench, discrepancy: Discrepancy, seed: int) -> Bench:
    """The bench on a line with waves, with injector, needle and moving rail of that."""
    plant = plant_of(discrepancy, seed)
    still, quiet = replace(plant.rail, dip=0.0, ripple=0.0), replace(plant.rail, pump=0.0)
    moved = (
        quiet.supply([(start + shot.start, shot.duration) for shot in event.shots], event.rail_pressure, 0.0)
        for start, event in zip(bench.starts, bench.events, strict=False)
    )
    supply = (still.supply([], bench.events[0].rail_pressure, np.random.default_rng(bench.seed).random()), *moved)
    around = replace(bench.around, supply=supply, before_noise=(*bench.around.before_noise, *plant.mounting))
    needle = needle_of(Rig(discrepancy, False, seed))
    return replace(bench, injector=plant.part, needle=needle, line=plant.line, around=around)


def worn_model(discrepancy: Discrepancy, seed: int, out: Path, laws: Laws = NO_LAWS) -> Path:
    """The injector file that `fit` makes of healthy recordings of a plant. Raises RunError where it fails."""
    folder = out / f"{discrepancy}-{seed}{'' if laws == NO_LAWS else f'-{zlib.crc32(str(laws).encode())}'}"
    weighed = folder / "masses.txt"

    def recorded(folder: Path) -> list[Path]:
        healthy = enumerate(healthy_benches(Rig(discrepancy, False, seed)))
        benches = {f"healthy_{number}": replace(bench, laws=laws) for number, bench in healthy}
        return write_recordings(folder, benches, weighed, WEIGHED_SIGMA, lift=True)

    return fitted_model(folder, recorded, ["--mass", str(weighed)] if discrepancy is Discrepancy.LENGTH else [])


def score_worn(discrepancy: Discrepancy, seed: int, number: int, model: Path, how: How) -> Row:
    case = worn_case(discrepancy, seed, number)
    return score_by(how, case, bench_at(case.bench.sample_rate, model))
