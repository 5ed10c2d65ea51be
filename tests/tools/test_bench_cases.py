"""The benchmark's cases: reproducible, and as varied as the bars say."""

import numpy as np
import pytest

from tests.plants.plant import record
from tools.benchmarks.cases import CLASSES, EVENTS, make_case


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
