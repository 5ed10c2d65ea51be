"""Plants under laws no vocabulary has: every kind is seen, off at size 0, as stated, in both tiers, and blind."""

import math
from dataclasses import replace

import numpy as np
import pytest

from observer_rt.model.effects import VOCABULARY
from observer_rt.model.terms.term import TermEquation as TheirEquation
from tests.plants.laws import Laws
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
from tools.benchmarks.discovery.kinds import HiddenKind, TermEquation
from tools.benchmarks.discovery.laws import KINDS, NOT_IN, VOCABULARY_KINDS
from tools.benchmarks.discovery.vocabulary import OUTSIDE

PLANTS: dict[str, tuple[Injector, WaveLine | None]] = {
    "A": (Injector(), None),
    "B": (new_part(), LINES[Variant.PLAIN]),
}
SEEN = 200.0  # of chi2 of two injections
OF_LEARNING = {"rail_growth", "shut_by_drop", "coking", "filling"}  # asked for in its tests
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


def excess(first: Outcome, second: Outcome) -> float:
    """Chi2 by which signals differ."""
    line = (first.measured.line_pressure - second.measured.line_pressure) / LINE_NOISE
    rail = (first.measured.rail_pressure - second.measured.rail_pressure) / RAIL_NOISE
    return float(np.sum(line**2) + np.sum(rail**2))


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_every_kind_is_seen_at_all_its_sizes_and_off_at_none(kind: HiddenKind, plant: str) -> None:
    first, *others = (p.lowest for p in kind.parameters)
    off = recorded(plant, kind, (OFF.get(kind.name, 0.0), *others))
    healthy = recorded(plant, replace(kind, step=None, supply=None), (0.0, *others))
    assert excess(off, healthy) < 1e-6
    for values in ((first, *others), tuple(p.highest for p in kind.parameters)):
        outcome = recorded(plant, kind, values)
        assert all(np.isfinite(signal).all() for signal in vars(outcome.measured).values())
        assert excess(outcome, healthy) > SEEN


def test_all_laws_are_used_and_nothing_else_is() -> None:
    used = {p.fault for kind in KINDS.values() for p in kind.parameters if p.fault}
    used |= {p.fault for kind in OUTSIDE.values() for p in kind.parameters if p.fault}
    assert set(Laws._fields) <= {*used, *OF_LEARNING, "control_flow", "control_lead", "control_trail"}
    assert used <= {*Laws._fields, *Faults._fields}
    assert all(kind.parameters[0].fault or kind.step for kind in KINDS.values())


def test_equations_are_those_of_terms() -> None:
    assert sorted(map(str, TermEquation)) == sorted(map(str, TheirEquation))


def test_names_of_the_vocabulary_are_all_there_and_no_kind_has_one() -> None:
    assert set(VOCABULARY_KINDS) == set(VOCABULARY) - {"control_flow"}
    assert not set(KINDS) & set(VOCABULARY)
    assert set().union(*NOT_IN.values()) <= set(VOCABULARY)
