"""Hidden cases on real lines, and the benches that record them. Imports nothing of `observer_rt`."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.random import Generator
from pydantic import TypeAdapter

from tests.plants.parameters import Faults
from tests.plants.plant import SAMPLE_RATE, Bench, Event, Needle, Shot, Step, Surroundings
from tools.benchmarks.discovery.cases import FURTHER, GIVEN, write_all
from tools.benchmarks.discovery.hiding import Hiding, label_of
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy, plant_of
from tools.benchmarks.discovery.real_line.hidden import (
    EFFECTS,
    OUTSIDE,
    PAIR_FROM,
    PAIRS,
    Parts,
    faults_of,
    known,
    laws_of,
    steps_of,
)

FIT_INJECTIONS, INJECTIONS = 6, 3  # in each recording
FIRST, DISTANCE = 40e-3, 50e-3  # s: start of the first injection, and from one to the next
NEEDLE_SPREAD = 0.15  # of a plant's speeds
SHARES = (0.20, 0.50, 0.15, 0.15)


class Kind(StrEnum):
    """What is hidden."""

    HEALTHY = "healthy"
    SINGLE = "single"  # one effect of the vocabulary
    PAIR = "pair"  # two of them
    OUTSIDE = "outside"  # what is not in the vocabulary


@dataclass(frozen=True)
class Rig:
    """One plant and how it is measured, healthy and not: by its discrepancy's number, and with a rate or without."""

    number: int
    with_rate: bool
    seed: int

    @property
    def discrepancy(self) -> Discrepancy:
        """What is wrong with every model of it."""
        return list(Discrepancy)[self.number]

    @property
    def name(self) -> str:
        """What its folder is called where the name tells nothing."""
        return f"{self.number}{self._suffix}"

    @property
    def open_name(self) -> str:
        """What it is called where nothing is hidden."""
        return f"{self.discrepancy}{self._suffix}"

    @property
    def _suffix(self) -> str:
        return "-with-rate" if self.with_rate else ""


@dataclass(frozen=True)
class RealCase:
    """What is sealed; `seed` makes all that is not the rig's."""

    label: str
    kind: Kind
    parts: Parts
    rig: Rig
    seed: int


@dataclass(frozen=True)
class Numbers:
    """How many cases of each kind."""

    healthy: int
    singles: int
    pairs: int
    outside: int

    @property
    def total(self) -> int:
        """Of all kinds."""
        return self.healthy + self.singles + self.pairs + self.outside


def shared_out(cases: int) -> Numbers:
    """The usual shares of so many cases."""
    healthy, _, pairs, outside = (round(share * cases) for share in SHARES)
    return Numbers(healthy, cases - healthy - pairs - outside, pairs, outside)


def make_cases(
    numbers: Numbers,
    rates: Sequence[bool],
    discrepancies: Sequence[Discrepancy],
    master_seed: int,
    chosen: Sequence[str] = (),
) -> tuple[RealCase, ...]:
    """Cases of every kind, spread over effects, discrepancies and rates, in an order that tells nothing.

    chosen: what is hidden instead, a name as of `names_of` for one case after another, whatever its kind. The first
    cases of a larger number are those of a smaller one.
    """
    kinds: list[tuple[Sequence[tuple[str, ...]], int]] = [
        (((),), numbers.healthy),
        ([(name,) for name in EFFECTS], numbers.singles),
        (PAIRS, numbers.pairs),
        ([(name,) for name in OUTSIDE], numbers.outside),
    ]
    if chosen:
        kinds = [([names_of(name) for name in chosen], numbers.total)]
    cases = []
    for turn, (hidden, count) in enumerate(kinds):
        for number in range(count):
            place = turn + number + number // len(hidden)  # not every effect on the same discrepancy
            discrepancy = discrepancies[place % len(discrepancies)]
            with_rate = rates[place // len(discrepancies) % len(rates)]
            rig = Rig(discrepancy.number, with_rate, master_seed)
            cases.append(make_case(hidden[number % len(hidden)], rig, number))
    return tuple(sorted(cases, key=lambda case: case.label))


def names_of(text: str) -> tuple[str, ...]:
    """Effects of `healthy`, `one` or `one+other`. Raises KeyError where one is not known."""
    names = () if text == Kind.HEALTHY else tuple(text.split("+"))
    for name in names:
        known(name)
    return names


def kind_of(names: Sequence[str]) -> Kind:
    """Of a case with these effects."""
    if not names:
        return Kind.HEALTHY
    if any(name in OUTSIDE for name in names):
        return Kind.OUTSIDE
    return Kind.SINGLE if len(names) == 1 else Kind.PAIR


def make_case(names: Sequence[str], rig: Rig, number: int) -> RealCase:
    """The case with this number among those of its kind, with these effects hidden on a rig."""
    kind = kind_of(names)
    key = [rig.seed, number, rig.number, int(rig.with_rate)]
    key += [zlib.crc32(name.encode()) for name in names]
    rng = np.random.default_rng(key)
    seed = int(rng.integers(2**62))
    lowest = PAIR_FROM if kind is Kind.PAIR else 0.0
    parts = tuple((name, known(name).draw(rng, lowest)) for name in names)
    return RealCase(label_of(key), kind, parts, rig, seed)


def hidden_text(parts: Parts) -> str:
    """What is in a case, sizes in SI."""
    sized = (f"{name} {' '.join(f'{value:.4g}' for value in values)}" for name, values in parts)
    return " + ".join(sized) or str(Kind.HEALTHY)


def healthy_benches(rig: Rig) -> tuple[Bench, ...]:
    """What `fit` is given of a rig."""
    rng = np.random.default_rng([rig.seed, rig.number, zlib.crc32(b"healthy")])
    return tuple(bench_of(rig, point, FIT_INJECTIONS, rng, Faults()) for point in GIVEN)


def given_benches(case: RealCase) -> tuple[Bench, ...]:
    """What `discover` is given of a case."""
    return _case_benches(case, GIVEN, 1.0)


def further_benches(case: RealCase) -> tuple[Bench, ...]:
    """The same plant at operating points that are never given, without noise."""
    return _case_benches(case, FURTHER, 0.0)


def _case_benches(case: RealCase, points: Sequence[tuple[float, float]], noise: float) -> tuple[Bench, ...]:
    rng = np.random.default_rng([case.seed, *(round(pressure) for pressure, _ in points)])
    faults, steps, laws = faults_of(case.parts), steps_of(case.parts), laws_of(case.parts)
    return tuple(
        replace(bench_of(case.rig, point, INJECTIONS, rng, faults, steps, noise), laws=laws)
        for point in points
    )


def bench_of(
    rig: Rig,
    point: tuple[float, float],
    injections: int,
    rng: Generator,
    faults: Faults,
    steps: tuple[Step, ...] = (),
    noise: float = 1.0,
) -> Bench:
    """One recording at one operating point, its injections anywhere on the grid of samples."""
    plant, (rail_pressure, duration) = plant_of(rig.discrepancy, rig.seed), point
    shots = [Shot(rng.uniform(0.0, 1.0 / SAMPLE_RATE), duration) for _ in range(injections)]
    starts = tuple(FIRST + DISTANCE * number for number in range(injections))
    openings = [(start + shot.start, duration) for start, shot in zip(starts, shots, strict=True)]
    supply = plant.rail.supply(openings, rail_pressure, rng.random())
    around = Surroundings(starts=starts, supply=(supply,), before_noise=(*plant.mounting, *steps))
    events = tuple(Event(rail_pressure, (shot,), faults) for shot in shots)
    seed = int(rng.integers(2**62))
    return Bench(plant.part, needle_of(rig), events, noise=noise, seed=seed, line=plant.line, around=around)


def needle_of(rig: Rig) -> Needle:
    """The needle of a rig."""
    rng = np.random.default_rng([rig.seed, rig.number, zlib.crc32(b"needle")])
    opening, closing = 1.0 + NEEDLE_SPREAD * rng.uniform(-1.0, 1.0, 2)
    return Needle(0.80 * opening, 0.90 * closing)


@dataclass(frozen=True)
class RealPlan:
    """What is drawn: numbers of cases, without and with measured rate, on which plants, seed, and what alone."""

    numbers: Numbers
    rates: tuple[bool, ...]
    discrepancies: tuple[Discrepancy, ...]
    master_seed: int
    chosen: tuple[str, ...] = ()


@dataclass(frozen=True)
class RigLabel:
    """What may be known of a case before it is opened: its rig, whose fitted model it is asked with.

    None: the nominal injector; without: names the vocabulary is asked without.
    """

    label: str
    rig: Rig | None
    without: tuple[str, ...] = ()


def write_healthy(labels: Sequence[RigLabel], name: str, target: Path) -> tuple[Path, ...]:
    """What the fit of a rig is given."""
    rig = next(label.rig for label in labels if label.rig is not None and label.rig.name == name)
    return write_all(healthy_benches(rig), rig.with_rate, target)


HIDING = Hiding(
    plan=TypeAdapter(RealPlan),
    cases=TypeAdapter(tuple[RealCase, ...]),
    labels=TypeAdapter(tuple[RigLabel, ...]),
    make=lambda plan: make_cases(plan.numbers, plan.rates, plan.discrepancies, plan.master_seed, plan.chosen),
    label_of=lambda case: RigLabel(case.label, case.rig),
    record=lambda case, target: write_all(given_benches(case), case.rig.with_rate, target),
    healthy=write_healthy,
)
