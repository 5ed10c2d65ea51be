"""Steady wear on fitted lines: its cases, its figures, its bars."""

from dataclasses import replace

import pytest

from tests.tools.made_scores import score
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.score import FROM, CaseScore
from tools.benchmarks.worn_lines import (
    DURATIONS,
    EVENTS,
    NOZZLE,
    RAIL_PRESSURES,
    SEAT,
    fallbacks,
    figures,
    make_case,
    outside,
    violations,
)


@pytest.mark.parametrize("discrepancy", list(Discrepancy))
def test_wear_stands_still_and_every_second_case_changes_its_point(discrepancy: Discrepancy) -> None:
    points = []
    for number in (0, 1):
        events = make_case(discrepancy, 5, number).bench.events
        assert len(events) == EVENTS
        (faults,) = {event.faults for event in events}
        assert 0.0 < abs(faults.orifice_area) <= NOZZLE
        assert 0.0 < abs(faults.seat_area) <= SEAT
        assert all(RAIL_PRESSURES[0] <= event.rail_pressure <= RAIL_PRESSURES[1] for event in events)
        assert all(DURATIONS[0] <= event.shots[0].duration <= DURATIONS[1] for event in events)
        points.append(len({event.rail_pressure for event in events}))
    assert points == [1, EVENTS]


def test_a_case_is_determined_by_its_number() -> None:
    one, same, other = (make_case(Discrepancy.TAPER, 5, number).bench for number in (3, 3, 4))
    assert (one.seed, one.events) == (same.seed, same.events)
    assert one.seed != other.seed


def worn(share: float, valid: bool = True) -> CaseScore:
    """All masses by this share off; the nominal model's 20 % low, the interval the truth +- 2 %."""
    reason = "" if valid else "SUDDEN_CHANGE"
    return score(1.0 + share, valid=(valid,) * EVENTS, reasons=(reason,) * EVENTS)


def test_a_mass_nearer_to_the_nominal_model_is_a_fallback() -> None:
    assert fallbacks(worn(0.01)) == 0
    assert fallbacks(worn(-0.15)) == EVENTS - FROM


def test_a_mass_beyond_the_interval_beside_it_is_counted() -> None:
    assert outside(worn(0.01)) == 0
    assert outside(worn(0.03)) == EVENTS


def test_figures_count_from_the_fifth_event_on() -> None:
    late = worn(0.001)
    late = replace(late, valid=(False,) * FROM + late.valid[FROM:])
    found = figures([late, worn(0.001)])
    assert found["valid_share"] == 1.0
    assert found["error_level_pct"] == pytest.approx(0.1)
    assert found["coverage_95_share"] == 1.0


def test_every_bar_can_be_missed() -> None:
    assert not [line for line in violations([worn(0.001)]) if "coverage" not in line]
    assert any("valid" in line for line in violations([worn(0.001, valid=False), worn(0.001)]))
    missed = " ".join(violations([worn(-0.15)]))
    for words in ("nearer to the nominal", "outside their own", "p95", "largest", "coverage", "wrong"):
        assert words in missed
