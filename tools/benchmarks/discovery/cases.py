"""Hidden cases: an opaque label, what is hidden, and the benches that record it. Imports nothing of `observer_rt`."""

import itertools
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from tests.plants.arrays import Array
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Outcome, Shot, drawn_needle, record
from tools.benchmarks.discovery.hidden import HEALTHY, HIDDEN
from tools.benchmarks.discovery.hiding import Hiding, label_of

GIVEN = tuple(itertools.product((60e6, 100e6, 140e6), (0.6e-3, 1.9e-3)))
"""Operating points `discover` is given: rail pressure [Pa], needle open [s]."""
FURTHER = tuple(itertools.product((80e6, 120e6), (0.9e-3, 1.5e-3)))
"""Operating points it never sees: there the gap is measured."""
MEGAPASCAL, MILLIMETRE, MM3_PER_MS = 1e6, 1e-3, 1e-6
HEADER = "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa"
INJECTIONS = 2  # in each recording
RATE_NOISE = 0.5e-6  # m3/s per sample of a measured rate at 100 kHz
RATE_GAIN = 0.005  # one sigma of a recording's gain


@dataclass(frozen=True)
class HiddenCase:
    """What is sealed: `values` are the parameters of the effect in its order; `seed` makes everything else."""

    label: str
    effect: str
    values: tuple[float, ...]
    with_rate: bool
    seed: int

    @property
    def faults(self) -> Faults:
        """What is wrong with the plant."""
        return Faults() if self.effect == HEALTHY else HIDDEN[self.effect].faults(self.values)


def make_case(effect: str, with_rate: bool, master_seed: int, number: int) -> HiddenCase:
    """The case with this number among those of its kind. Raises KeyError for an unknown effect."""
    key = [master_seed, zlib.crc32(effect.encode()), int(with_rate), number]
    rng = np.random.default_rng(key)
    seed = int(rng.integers(2**62))
    values = () if effect == HEALTHY else tuple(p.draw(rng) for p in HIDDEN[effect].parameters)
    label = label_of(key)
    return HiddenCase(label, effect, values, with_rate, seed)


def make_cases(
    effects: tuple[str, ...], faulty: int, healthy: int, rates: tuple[bool, ...], master_seed: int
) -> tuple[HiddenCase, ...]:
    """`faulty` cases spread evenly over effects and rates, `healthy` ones over rates, in an order that tells nothing.

    The first cases of a larger number are those of a smaller one.
    """
    kinds = [
        (effect, rates[(number + turn) % len(rates)])
        for turn in range(len(rates))
        for number, effect in enumerate(effects)
    ]
    cases = [make_case(*kinds[i % len(kinds)], master_seed, i // len(kinds)) for i in range(faulty)]
    cases += [make_case(HEALTHY, rates[i % len(rates)], master_seed, i // len(rates)) for i in range(healthy)]
    return tuple(sorted(cases, key=lambda case: case.label))


def benches(
    case: HiddenCase, points: tuple[tuple[float, float], ...], noise: float = 1.0
) -> tuple[Bench, ...]:
    """One bench a recording: one operating point, its injections anywhere on the grid of samples."""
    rng = np.random.default_rng(case.seed)
    needle = drawn_needle(rng)
    rng = np.random.default_rng([case.seed, *(round(pressure) for pressure, _ in points)])
    made = []
    for rail_pressure, duration in points:
        shots = [Shot(rng.uniform(0.0, 10e-6), duration) for _ in range(INJECTIONS)]
        events = tuple(Event(rail_pressure, (shot,), case.faults) for shot in shots)
        made.append(Bench(Injector(), needle, events, noise=noise, seed=int(rng.integers(2**62))))
    return tuple(made)


def measured_rate(bench: Bench, outcome: Outcome) -> Array:
    """Rate an instrument measures beside the injector [m3/s] (n,): white noise, and a gain error of the recording.

    Of a bench without noise the true rate.
    """
    rng = np.random.default_rng([bench.seed, 1])
    truth = outcome.truth.injection_rate
    gain = 1.0 + RATE_GAIN * bench.noise * rng.normal()
    return np.asarray(gain * truth + RATE_NOISE * bench.noise * rng.normal(size=truth.size), np.float64)


def without_noise(case: HiddenCase, points: tuple[tuple[float, float], ...]) -> tuple[Bench, ...]:
    """The same benches without noise."""
    return tuple(replace(bench, noise=0.0) for bench in benches(case, points))


@dataclass(frozen=True)
class HidingPlan:
    """What is drawn: numbers of cases, effects, without and with measured rate, seed."""

    effects: tuple[str, ...]
    faulty: int
    healthy: int
    rates: tuple[bool, ...]
    master_seed: int


def write_recordings(case: HiddenCase, folder: Path) -> tuple[Path, ...]:
    """The recordings of a case."""
    return write_all(benches(case, GIVEN), case.with_rate, folder)


def write_all(benches: Iterable[Bench], with_rate: bool, folder: Path) -> tuple[Path, ...]:
    """Recordings as CSV files, named by nothing but their order."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number, bench in enumerate(benches, start=1):
        files.append(folder / f"recording_{number}.csv")
        write_recording(files[-1], bench, with_rate)
    return tuple(files)


def write_recording(path: Path, bench: Bench, with_rate: bool) -> None:
    """What a bench records, as CSV file."""
    outcome = record(bench)
    measured = outcome.measured
    columns: list[Array] = [
        measured.time,
        measured.rail_pressure / MEGAPASCAL,
        measured.needle_lift / MILLIMETRE,
        measured.line_pressure / MEGAPASCAL,
    ]
    header, row = HEADER, "%.5f,%.3f,%.5f,%.3f"
    if with_rate:
        columns.append(measured_rate(bench, outcome) / MM3_PER_MS)
        header, row = f"{header},injection_rate_mm3_per_ms", f"{row},%.5f"
    lines = [row % values for values in zip(*(c.tolist() for c in columns), strict=True)]
    path.write_text("\n".join([header, *lines]) + "\n")


HIDING = Hiding(
    plan=TypeAdapter(HidingPlan),
    cases=TypeAdapter(tuple[HiddenCase, ...]),
    labels=TypeAdapter(tuple[str, ...]),
    make=lambda plan: make_cases(plan.effects, plan.faulty, plan.healthy, plan.rates, plan.master_seed),
    label_of=lambda case: case.label,
    record=write_recordings,
)
