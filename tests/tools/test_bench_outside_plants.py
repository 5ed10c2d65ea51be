"""Plants under laws no vocabulary has: every kind is seen, off at size 0, as stated, in both tiers, and blind."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from observer_rt.model.effects import VOCABULARY
from observer_rt.model.terms.term import TermEquation as TheirEquation
from tests.plants.equations import chamber_pressure, seat_factor
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import (
    LINE_NOISE,
    RAIL_NOISE,
    Bench,
    Event,
    Needle,
    Outcome,
    Shot,
    Surroundings,
    record,
)
from tests.plants.wave import LINES, Variant, WaveLine, new_part
from tests.tools.test_bench_real_line_plants import short
from tools.benchmarks.discovery.cases import (
    OUTSIDE_INJECTIONS,
    Asked,
    HiddenCase,
    outside_benches,
    outside_cases,
)
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.discovery.kinds import HiddenKind, TermEquation
from tools.benchmarks.discovery.laws import KINDS, NOT_IN, VOCABULARY_KINDS
from tools.benchmarks.discovery.rigs import FURTHER, GIVEN, Rig
from tools.benchmarks.discovery.vocabulary import OUTSIDE

PLANTS: dict[str, tuple[Injector, WaveLine | None]] = {
    "A": (Injector(), None),
    "B": (new_part(), LINES[Variant.PLAIN]),
}
SEEN = 200.0  # of chi2 of two injections
OFF = {"tap_resonance": math.inf}  # where the first parameter is not a size


def recorded(plant: str, kind: HiddenKind, values: tuple[float, ...]) -> Outcome:
    """The third injection and the fourth, at a low and a high rail pressure, without noise."""
    part, line = PLANTS[plant]
    events = tuple(
        Event(pressure, (Shot(3e-6, 1.2e-3),), kind.faults(values, number))
        for number, pressure in enumerate((65e6, 140e6), start=2)
    )
    around = Surroundings(starts=(0.005, 0.06), supply=kind.supplies(values), before_noise=kind.steps(values))
    laws = kind.laws(values)
    return record(Bench(part, Needle(), events, noise=0.0, line=line, around=around, laws=laws))


def excess(one: Outcome, other: Outcome) -> float:
    """Chi2 by which signals differ."""
    line = (one.measured.line_pressure - other.measured.line_pressure) / LINE_NOISE
    rail = (one.measured.rail_pressure - other.measured.rail_pressure) / RAIL_NOISE
    return float(np.sum(line**2) + np.sum(rail**2))


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_every_kind_is_seen_at_all_its_sizes_and_off_at_none(kind: HiddenKind, plant: str) -> None:
    first, *others = (p.lowest for p in kind.parameters)
    off = recorded(plant, kind, (OFF.get(kind.name, 0.0), *others))
    healthy = recorded(plant, replace(kind, step=None, supply=None), (0.0, *others))
    assert excess(off, healthy) < 1e-6
    for values in ((first, *others), tuple(p.highest for p in kind.parameters)):
        there = recorded(plant, kind, values)
        assert all(np.isfinite(signal).all() for signal in vars(there.measured).values())
        assert excess(there, healthy) > SEEN


def test_all_laws_are_used_and_nothing_else_is() -> None:
    used = {p.fault for kind in KINDS.values() for p in kind.parameters if p.fault}
    used |= {p.fault for kind in OUTSIDE.values() for p in kind.parameters if p.fault}
    assert set(Laws._fields) <= used
    assert used <= {*Laws._fields, *Faults._fields}
    assert all(kind.parameters[0].fault or kind.step for kind in KINDS.values())


def steady(plant: str, laws: Laws) -> Outcome:
    part, line = PLANTS[plant]
    return short(part, line, Faults(), duration=4e-3, noise=0.0, laws=laws)


@pytest.mark.parametrize("plant", PLANTS)
def test_what_holds_the_flow_back_takes_pressure(plant: str) -> None:
    window = slice(1150, 1350)
    part, _ = PLANTS[plant]
    flow = float(np.mean(steady(plant, NO_LAWS).truth.injection_rate[window]))
    inertance = part.density * part.line_length / part.line_area
    for laws, loss in ((Laws(line_laminar=300.0), 300.0 * inertance * flow), (Laws(stiction=1e6), 1e6)):
        there, healthy = (steady(plant, each).truth.line_pressure[window] for each in (laws, NO_LAWS))
        assert np.mean(healthy - there) == pytest.approx(loss, rel=0.15)


@pytest.mark.parametrize("plant", PLANTS)
def test_the_chamber_s_pressure_grows_with_what_is_injected(plant: str) -> None:
    slope, window = 1e11, slice(1150, 1350)
    part, _ = PLANTS[plant]
    truth = steady(plant, Laws(flow_back_pressure=slope)).truth
    rate, drop = truth.injection_rate[window], truth.sac_pressure[window] - part.chamber_pressure
    coefficient = part.nozzle_area * math.sqrt(2.0 / part.density)
    np.testing.assert_allclose(rate, coefficient * np.sqrt(drop - slope * rate), rtol=2e-3)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_needle_that_is_not_shut_lets_through_what_the_seat_does(plant: str) -> None:
    part, _ = PLANTS[plant]
    truth = steady(plant, Laws(least_lift=2e-6)).truth
    before = slice(800, 950)
    drop = truth.line_pressure[before] - truth.sac_pressure[before]
    expected = seat_factor(2e-6, part, Faults()) * np.sqrt(drop)
    assert np.mean(truth.injection_rate[before]) == pytest.approx(np.mean(expected), rel=0.02)
    assert np.max(truth.needle_lift[before]) == 0.0  # is not seen
    assert chamber_pressure(0.0, part, Faults()) == part.chamber_pressure


@pytest.mark.parametrize(
    ("name", "shares"), [("coking_nozzle", [0.0, 1.0, 2.0, 3.0]), ("plugged_hole", [0.0, 1.0, 1.0, 1.0])]
)
def test_what_goes_by_the_number_of_an_injection_closes_the_nozzle(name: str, shares: list[float]) -> None:
    case = HiddenCase("x", Asked.OUTSIDE, ((name, (0.1,)),), False, None, 5)
    areas = [event.faults.orifice_area for event in outside_benches(case, GIVEN)[0].events]
    assert areas == pytest.approx([-0.1 * share for share in shares])


def test_equations_are_those_of_terms() -> None:
    assert sorted(map(str, TermEquation)) == sorted(map(str, TheirEquation))


def test_names_of_the_vocabulary_are_all_there_and_no_kind_has_one() -> None:
    assert set(VOCABULARY_KINDS) == set(VOCABULARY)
    assert not set(KINDS) & set(VOCABULARY)
    assert set().union(*NOT_IN.values()) <= set(VOCABULARY)


def test_one_case_of_everything_or_so_many_in_their_shares() -> None:
    every, rates = tuple(Discrepancy), (False, True)
    all_kinds = outside_cases("A", 0, rates, every, 3)
    counts = Counter((case.asked, case.name) for case in all_kinds)
    assert set(counts.values()) == {2}
    assert len(counts) == len(KINDS) + 2 * (len(VOCABULARY_KINDS) - len(NOT_IN["A"])) + 1
    many, few = (outside_cases("B", n, rates, every, 3) for n in (200, 100))
    assert Counter(case.asked for case in many) == {
        Asked.OUTSIDE: 100, Asked.LEFT_OUT: 40, Asked.SINGLE: 40, Asked.HEALTHY: 20,
    }  # fmt: skip
    assert many == outside_cases("B", 200, rates, every, 3)
    assert {case.label for case in few} < {case.label for case in many}
    sizes = [case.parts for case in many if case.name == "laminar_friction"]
    assert len(set(sizes)) == len(sizes) > 2
    assert len({case.rig for case in many}) == 14
    (alone,) = outside_cases("A", 0, (True,), every, 3, names=("stop_loss",))
    assert (alone.name, alone.with_rate, alone.rig) == ("stop_loss", True, None)


@pytest.mark.parametrize("rig", [None, Rig(Discrepancy.TAPER, False, 1)])
def test_given_and_further_recordings_share_the_plant_and_its_law(rig: Rig | None) -> None:
    values = tuple(p.highest for p in KINDS["slow_friction"].parameters)
    case = HiddenCase("x", Asked.OUTSIDE, (("slow_friction", values),), False, rig, 5)
    given, further = outside_benches(case, GIVEN), outside_benches(case, FURTHER, 0.0)
    assert [len(given), len(further)] == [len(GIVEN), len(FURTHER)]
    assert {len(bench.events) for bench in (*given, *further)} == {OUTSIDE_INJECTIONS}
    assert {bench.laws for bench in (*given, *further)} == {KINDS["slow_friction"].laws(values)}
    assert len({(b.injector, b.needle, b.line) for b in (*given, *further)}) == 1
    assert not {b.events[0].rail_pressure for b in given} & {b.events[0].rail_pressure for b in further}
    assert ({b.noise for b in given}, {b.noise for b in further}) == ({1.0}, {0.0})
