"""The benchmark's cases: reproducible, and as varied as the bars say."""

import numpy as np
import pytest

from tests.plants.plant import record
from tools.benchmarks.cases import CLASSES, EVENTS, make_case

MANY = range(300)


def test_a_case_is_determined_by_class_seed_and_number() -> None:
    first, again = make_case("mixture", 5, 3), make_case("mixture", 5, 3)
    assert first == again
    np.testing.assert_array_equal(
        record(first.bench).measured.line_pressure, record(again.bench).measured.line_pressure
    )
    others = [make_case("mixture", 5, 4), make_case("mixture", 6, 3), make_case("healthy", 5, 3)]
    assert len({c.bench.seed for c in [first, *others]}) == 4


@pytest.mark.parametrize("name", CLASSES)
def test_every_opening_is_seen_in_its_event(name: str) -> None:
    case = make_case(name, 1, 0)
    outcome = record(case.bench)
    expected = [i for i, event in enumerate(case.bench.events) for _ in event.shots]
    assert outcome.event_of.tolist() == expected
    durations = (outcome.openings[:, 1] - outcome.openings[:, 0]) / case.bench.sample_rate
    assert durations.min() > 0.2e-3
    assert durations.max() < 3.1e-3
    assert len([event for event in case.bench.events if event.shots]) == EVENTS


def test_operating_points_span_the_range() -> None:
    cases = [make_case("healthy", 2, n) for n in MANY]
    rails = np.array([[e.rail_pressure for e in c.bench.events] for c in cases])
    assert rails.min() < 42e6
    assert rails.max() > 158e6
    varying = np.mean(np.ptp(rails, axis=1) > 0.0)
    piloted = np.mean([len(c.bench.events[0].shots) > 1 for c in cases])
    assert 0.4 < varying < 0.6
    assert 0.25 < piloted < 0.42


def test_jumps_begin_healthy_and_growing_wear_grows() -> None:
    jump = make_case("jump_friction", 1, 1)
    assert jump.change_event is not None
    friction = [e.faults.line_friction for e in jump.bench.events]
    assert friction == [0.0] * jump.change_event + [2.0] * (EVENTS - jump.change_event)
    growing = [e.faults.orifice_area for e in make_case("growing_wear", 1, 1).bench.events]
    assert np.ptp(np.diff(growing)) < 1e-12
    assert abs(growing[-1]) > abs(growing[0]) > 0.0
