"""Hidden cases outside the vocabulary, and the benches that record them. Imports nothing of `observer_rt`."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import SAMPLE_RATE, Bench, Event, Needle, Shot, Surroundings
from tools.benchmarks.discovery.cases import FURTHER, GIVEN, write_all
from tools.benchmarks.discovery.hiding import Hiding, label_of
from tools.benchmarks.discovery.outside.kinds import KINDS, NOT_IN, VOCABULARY_KINDS, kind_named
from tools.benchmarks.discovery.real_line.cases import DISTANCE, FIRST, Rig, RigLabel, bench_of
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy

INJECTIONS = 4  # in each recording
SAME_TO_RECORDINGS = ({"bulk_modulus", "line_volume"},)
"""Names of the vocabulary that are one to any recording, and are taken away together."""
GIVEN_FOLDER, FURTHER_FOLDER, HEALTHY_FOLDER = "given", "further", "healthy"  # of a case


class Asked(StrEnum):
    """What is hidden, and with which vocabulary it is asked for."""

    OUTSIDE = "outside"  # what no name is for
    LEFT_OUT = "left_out"  # an effect whose name is taken away
    NAMED = "named"  # an effect of the vocabulary, all of which is there
    HEALTHY = "healthy"  # nothing


SHARES = {Asked.OUTSIDE: 0.5, Asked.LEFT_OUT: 0.2, Asked.NAMED: 0.2, Asked.HEALTHY: 0.1}


@dataclass(frozen=True)
class OutsideCase:
    """What is sealed. rig: the plant of tier B; None: of tier A; seed: makes everything else."""

    label: str
    asked: Asked
    name: str
    values: tuple[float, ...]
    with_rate: bool
    rig: Rig | None
    seed: int


@dataclass(frozen=True)
class OutsidePlan:
    """What is drawn.

    cases: of all askings together, 0: one of every kind and rate for what is asked; names: of what alone is hidden.
    """

    tier: str
    cases: int
    rates: tuple[bool, ...]
    master_seed: int
    discrepancies: tuple[str, ...] = tuple(map(str, Discrepancy))
    names: tuple[str, ...] = ()


def make_cases(plan: OutsidePlan) -> tuple[OutsideCase, ...]:
    """Cases of every asking, spread over kinds, plants and rates, in an order that tells nothing."""
    made = []
    for asked, share in SHARES.items():
        names = [name for name in _names(asked, plan.tier) if not plan.names or name in plan.names]
        count = round(share * plan.cases) if plan.cases else len(names) * len(plan.rates)
        if names:
            made += [_make_case(asked, names, number, plan) for number in range(count)]
    return tuple(sorted(made, key=lambda case: case.label))


def _names(asked: Asked, tier: str) -> list[str]:
    if asked is Asked.HEALTHY:
        return [str(Asked.HEALTHY)]
    return list(KINDS) if asked is Asked.OUTSIDE else [n for n in VOCABULARY_KINDS if n not in NOT_IN[tier]]


def _make_case(asked: Asked, names: Sequence[str], number: int, plan: OutsidePlan) -> OutsideCase:
    """The case with this number of an asking: kind after kind, then the next rate, with other sizes and plants."""
    turn, place = divmod(number, len(names))
    name, with_rate = names[place], plan.rates[turn % len(plan.rates)]
    rig = None
    if plan.tier == "B":
        discrepancy = plan.discrepancies[(place + turn) % len(plan.discrepancies)]
        rig = Rig(Discrepancy(discrepancy).number, with_rate, plan.master_seed)
    key = [plan.master_seed, zlib.crc32(f"{asked} {name} {plan.tier}".encode()), int(with_rate), turn]
    rng = np.random.default_rng(key)
    seed = int(rng.integers(2**62))
    values = () if asked is Asked.HEALTHY else kind_named(name).draw(rng)
    return OutsideCase(label_of(key), asked, name, values, with_rate, rig, seed)


def given_benches(case: OutsideCase) -> tuple[Bench, ...]:
    """What `discover` is given."""
    return _benches(case, GIVEN, 1.0)


def further_benches(case: OutsideCase) -> tuple[Bench, ...]:
    """The same plant at operating points that are never given, without noise."""
    return _benches(case, FURTHER, 0.0)


def _benches(case: OutsideCase, points: Sequence[tuple[float, float]], noise: float) -> tuple[Bench, ...]:
    rng = np.random.default_rng([case.seed, *(round(pressure) for pressure, _ in points)])
    return tuple(_with_hidden(_healthy(case, point, rng, noise), case) for point in points)


def _healthy(case: OutsideCase, point: tuple[float, float], rng: np.random.Generator, noise: float) -> Bench:
    """One recording of the plant at one operating point; of tier A with a rail at rest."""
    if case.rig is not None:
        return bench_of(case.rig, point, INJECTIONS, rng, Faults(), noise=noise)
    speeds = np.random.default_rng(case.seed).uniform(0.85, 1.15, 2)
    rail_pressure, duration = point
    shots = [Shot(rng.uniform(0.0, 1.0 / SAMPLE_RATE), duration) for _ in range(INJECTIONS)]
    events = tuple(Event(rail_pressure, (shot,), Faults()) for shot in shots)
    around = Surroundings(starts=tuple(FIRST + DISTANCE * number for number in range(INJECTIONS)))
    needle = Needle(0.80 * speeds[0], 0.90 * speeds[1])
    return Bench(Injector(), needle, events, noise=noise, seed=int(rng.integers(2**62)), around=around)


def _with_hidden(bench: Bench, case: OutsideCase) -> Bench:
    """The bench with what is hidden: laws, faults of every injection, sensors, rail."""
    if case.asked is Asked.HEALTHY:
        return bench
    kind, values, around = kind_named(case.name), case.values, bench.around
    return replace(
        bench,
        laws=kind.laws(values),
        events=tuple(replace(e, faults=kind.faults(values, i)) for i, e in enumerate(bench.events)),
        around=replace(
            around,
            supply=(*around.supply, *kind.supplies(values)),
            before_noise=(*around.before_noise, *kind.steps(values)),
        ),
    )


def taken_away(case: OutsideCase) -> tuple[str, ...]:
    """Names the vocabulary is asked without."""
    if case.asked is not Asked.LEFT_OUT:
        return ()
    return tuple(sorted(next((same for same in SAME_TO_RECORDINGS if case.name in same), {case.name})))


def record_case(case: OutsideCase, target: Path) -> tuple[Path, ...]:
    """The recordings of a case: what is given, and what is not, the plant without noise and with its true rate.

    Of what is not given, also the plant with nothing hidden.
    """
    given = write_all(given_benches(case), case.with_rate, target / GIVEN_FOLDER)
    healthy = further_benches(replace(case, asked=Asked.HEALTHY))
    return (
        *given,
        *write_all(further_benches(case), True, target / FURTHER_FOLDER),
        *write_all(healthy, True, target / HEALTHY_FOLDER),
    )


HIDING = Hiding(
    plan=TypeAdapter(OutsidePlan),
    cases=TypeAdapter(tuple[OutsideCase, ...]),
    labels=TypeAdapter(tuple[RigLabel, ...]),
    make=make_cases,
    label_of=lambda case: RigLabel(case.label, case.rig, taken_away(case)),
    record=record_case,
)
