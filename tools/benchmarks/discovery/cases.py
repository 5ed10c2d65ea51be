"""Hidden cases of the campaigns, and the benches that record them. Imports nothing of `observer_rt`.

Labels and draws follow from a master seed; the first cases of a larger number are those of a smaller one.
"""

import hashlib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.random import Generator

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import SAMPLE_RATE, Bench, Event, Shot, Surroundings, drawn_needle
from tests.plants.real import Setting
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.discovery.kinds import RECIPROCAL, HiddenKind
from tools.benchmarks.discovery.laws import ALL_KINDS, KINDS, NOT_IN, PRODUCT_KINDS, VOCABULARY_KINDS
from tools.benchmarks.discovery.rigs import DISTANCE, FIRST, Rig, bench_of
from tools.benchmarks.discovery.vocabulary import ALL_EFFECTS, EFFECTS, HIDDEN, OUTSIDE, PAIR_FROM, PAIRS, Parts

HEALTHY = "healthy"
NOMINAL_INJECTIONS, REAL_INJECTIONS, OUTSIDE_INJECTIONS = 2, 3, 4  # in each recording
REAL_SHARES = {"healthy": 0.20, "pair": 0.15, "outside": 0.15}  # the rest are single effects
SERVO = (Setting.CAR, Setting.HEAVY_DUTY)
SERVO_HIDDEN = (
    *("orifice_area", "seat_area", "line_friction", "bulk_modulus", "entrained_air", "guide_leakage"),
    *("line_pressure_sensor_lag", "needle_lift_sensor_lag", *OUTSIDE, "stop_loss", "viscous_nozzle"),
)
"""Hidden in injectors with a pilot valve, as well visible as in a pair."""
FITTED_KINDS = KINDS | ALL_EFFECTS
Points = Sequence[tuple[float, float]]


class Query(StrEnum):
    """The kind of effect that is hidden, and the vocabulary it is asked for with."""

    HEALTHY = "healthy"  # nothing
    SINGLE = "single"  # one effect of the vocabulary, all of which is there
    PAIR = "pair"  # two of them
    OUTSIDE = "outside"  # what no name is for
    LEFT_OUT = "left_out"  # an effect whose name is taken away
    PRODUCT = "product"  # a law of two inputs at once


OUTSIDE_SHARES = {Query.OUTSIDE: 0.5, Query.LEFT_OUT: 0.2, Query.SINGLE: 0.2, Query.HEALTHY: 0.1, Query.PRODUCT: 0.25}
"""Of a count; products are beside it."""


@dataclass(frozen=True)
class HiddenCase:
    """One case. rig: None for the nominal structure; seed: makes all that is not the rig's."""

    label: str
    asked: Query
    parts: Parts
    with_rate: bool
    rig: Rig | None
    seed: int

    @property
    def name(self) -> str:
        return "+".join(name for name, _ in self.parts) or HEALTHY

    @property
    def text(self) -> str:
        sized = (f"{name} {' '.join(f'{value:.4g}' for value in values)}" for name, values in self.parts)
        rate, line = " with rate" if self.with_rate else "", f" {self.rig.discrepancy}" if self.rig else ""
        return f"{self.label}{line}{rate}: {' + '.join(sized) or HEALTHY}"


def _drawn(
    key: list[int],
    asked: Query,
    kinds: Sequence[HiddenKind],
    with_rate: bool,
    rig: Rig | None,
    from_share: float | None = None,
) -> HiddenCase:
    """The case of a key, on which all of it depends; its label tells nothing of it."""
    rng = np.random.default_rng(key)
    seed = int(rng.integers(2**62))
    parts = tuple((kind.name, kind.draw(rng, from_share)) for kind in kinds)
    return HiddenCase(hashlib.sha256(repr(key).encode()).hexdigest()[:12], asked, parts, with_rate, rig, seed)


def nominal_cases(effects: Sequence[str], count: int, rates: Sequence[bool], seed: int) -> list[HiddenCase]:
    """Tier A: so many faulty cases spread evenly over effects and rates, and as many healthy ones."""

    def case(effect: str, with_rate: bool, number: int) -> HiddenCase:
        key = [seed, zlib.crc32(effect.encode()), int(with_rate), number]
        kinds = [] if effect == HEALTHY else [HIDDEN[effect]]
        return _drawn(key, Query.SINGLE if kinds else Query.HEALTHY, kinds, with_rate, None)

    kinds = [(name, rates[(n + turn) % len(rates)]) for turn in range(len(rates)) for n, name in enumerate(effects)]
    cases = [case(*kinds[i % len(kinds)], i // len(kinds)) for i in range(count)]
    return cases + [case(HEALTHY, rates[i % len(rates)], i // len(rates)) for i in range(count)]


def nominal_benches(case: HiddenCase, points: Points, noise: float = 1.0) -> list[Bench]:
    """One bench a recording: one operating point, its injections anywhere on the grid of samples."""
    rng = _of_points(case, points)
    healthy = [_at_rest(case, point, rng, noise, NOMINAL_INJECTIONS) for point in points]
    return [_with_hidden(bench, case, HIDDEN) for bench in healthy]


def real_cases(
    count: int,
    healthy: int | None,
    rates: Sequence[bool],
    discrepancies: Sequence[Discrepancy],
    seed: int,
    chosen: Sequence[str] = (),
) -> list[HiddenCase]:
    """Tier B: cases of every kind, spread over effects, discrepancies and rates.

    healthy: how many, else their share; chosen: effects to hide instead, in turn: `healthy`, a name, or `one+other`.
    """
    numbers = {kind: round(share * count) for kind, share in REAL_SHARES.items()}
    singles = count - sum(numbers.values())
    numbers["healthy"] = numbers["healthy"] if healthy is None else healthy
    kinds: list[tuple[Sequence[tuple[str, ...]], int]] = [
        (((),), numbers["healthy"]),
        ([(name,) for name in EFFECTS], singles),
        (PAIRS, numbers["pair"]),
        ([(name,) for name in OUTSIDE], numbers["outside"]),
    ]
    if chosen:
        names = [() if name == HEALTHY else tuple(name.split("+")) for name in chosen]
        kinds = [(names, singles + sum(numbers.values()))]
    cases = []
    for turn, (hidden, number_of) in enumerate(kinds):
        for number in range(number_of):
            slot = turn + number + number // len(hidden)  # not every effect on the same discrepancy
            with_rate = rates[slot // len(discrepancies) % len(rates)]
            rig = Rig(discrepancies[slot % len(discrepancies)], with_rate, seed)
            cases.append(real_case(hidden[number % len(hidden)], rig, number))
    return cases


def real_case(names: Sequence[str], rig: Rig, number: int) -> HiddenCase:
    """The case with this number among those of its kind, with these effects hidden on a rig."""
    asked = Query.HEALTHY if not names else Query.SINGLE if len(names) == 1 else Query.PAIR
    asked = Query.OUTSIDE if any(name in OUTSIDE for name in names) else asked
    from_share = PAIR_FROM if asked is Query.PAIR else None
    key = [rig.seed, number, rig.number, int(rig.with_rate), *(zlib.crc32(n.encode()) for n in names)]
    return _drawn(key, asked, [ALL_EFFECTS[name] for name in names], rig.with_rate, rig, from_share)


def servo_cases(count: int, seed: int, chosen: Sequence[str] = ()) -> list[HiddenCase]:
    """Tier C: so many of every effect and law, and four times as many healthy ones, in turn; chosen: of these."""
    hidden = [name for name in (*SERVO_HIDDEN, *[HEALTHY] * 4) if not chosen or name in chosen]
    cases = []
    for number, name in enumerate(hidden * count):
        rig = Rig(SERVO[(number + number // len(hidden)) % len(SERVO)], False, seed)
        asked = Query.HEALTHY if name == HEALTHY else Query.SINGLE if name in EFFECTS else Query.OUTSIDE
        key = [seed, number, zlib.crc32(f"{rig.discrepancy} {name}".encode())]
        kinds = [FITTED_KINDS[name]] if name != HEALTHY else []
        cases.append(_drawn(key, asked, kinds, False, rig, PAIR_FROM))
    return cases


def real_benches(case: HiddenCase, points: Points, noise: float = 1.0) -> list[Bench]:
    """One bench a recording of the case's rig."""
    assert case.rig is not None
    rng = _of_points(case, points)
    healthy = [bench_of(case.rig, point, REAL_INJECTIONS, rng, noise) for point in points]
    return [_with_hidden(bench, case, FITTED_KINDS) for bench in healthy]


def outside_cases(
    tier: str,
    count: int,
    rates: Sequence[bool],
    discrepancies: Sequence[Discrepancy],
    seed: int,
    names: Sequence[str] = (),
) -> list[HiddenCase]:
    """Cases of every asking, spread over kinds, plants and rates.

    count: of all askings together, 0: one of every kind and rate; names: of what alone is hidden, or askings.
    """
    named = [name for name in VOCABULARY_KINDS if name not in NOT_IN[tier]]
    of_asked = dict(zip(OUTSIDE_SHARES, ([*KINDS], named, named, [HEALTHY], [*PRODUCT_KINDS]), strict=True))
    made = []
    for asked, share in OUTSIDE_SHARES.items():
        hidden = [name for name in of_asked[asked] if not names or name in names or asked in names]
        for number in range(round(share * count) if count else len(hidden) * len(rates)) if hidden else ():
            # kind after kind, then the next rate, with other sizes and plants
            turn, index = divmod(number, len(hidden))
            name, with_rate = hidden[index], rates[turn % len(rates)]
            plant = discrepancies[(index + turn) % len(discrepancies)]
            rig = Rig(plant, with_rate, seed) if tier == "B" else None
            drawn_by = f"{'named' if asked is Query.SINGLE else asked} {name} {tier}"
            key = [seed, zlib.crc32(drawn_by.encode()), int(with_rate), turn]
            made.append(_drawn(key, asked, [] if name == HEALTHY else [ALL_KINDS[name]], with_rate, rig))
    return made


def outside_benches(case: HiddenCase, points: Points, noise: float = 1.0) -> list[Bench]:
    """One bench a recording of the case's rig; of tier A of a plant whose rail is at rest."""
    rng, rig, count = _of_points(case, points), case.rig, OUTSIDE_INJECTIONS
    around = Surroundings(starts=tuple(FIRST + DISTANCE * number for number in range(count)))
    healthy = [
        bench_of(rig, point, count, rng, noise) if rig else _at_rest(case, point, rng, noise, count, around)
        for point in points
    ]
    return [_with_hidden(bench, case, ALL_KINDS) for bench in healthy]


def taken_away(case: HiddenCase) -> tuple[str, ...]:
    """Names the vocabulary is asked without: all that are one to any recording."""
    if case.asked is not Query.LEFT_OUT:
        return ()
    return tuple(sorted(RECIPROCAL if case.name in RECIPROCAL else {case.name}))


def _at_rest(
    case: HiddenCase, point: tuple[float, float], rng: Generator, noise: float, injections: int, *around: Surroundings
) -> Bench:
    (pressure, duration), needle = point, drawn_needle(np.random.default_rng(case.seed))
    shots = [Shot(rng.uniform(0.0, 1.0 / SAMPLE_RATE), duration) for _ in range(injections)]
    events = tuple(Event(pressure, (shot,), Faults()) for shot in shots)
    bench = Bench(Injector(), needle, events, noise=noise, seed=int(rng.integers(2**62)))
    return replace(bench, around=around[0]) if around else bench


def _of_points(case: HiddenCase, points: Points) -> Generator:
    return np.random.default_rng([case.seed, *(round(pressure) for pressure, _ in points)])


def _with_hidden(bench: Bench, case: HiddenCase, kinds: Mapping[str, HiddenKind]) -> Bench:
    """The bench with the effects hidden in laws, injections, sensors and rail."""
    for name, values in case.parts:
        kind, around = kinds[name], bench.around
        events = tuple(replace(e, faults=kind.faults(values, i, e.faults)) for i, e in enumerate(bench.events))
        supply, steps = (*around.supply, *kind.supplies(values)), (*around.before_noise, *kind.steps(values))
        around = replace(around, supply=supply, before_noise=steps)
        bench = replace(bench, laws=kind.laws(values, bench.laws), events=events, around=around)
    return bench
