"""Steady wear on fitted lines: its cases."""

import pytest

from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.worn_lines import DURATIONS, EVENTS, NOZZLE, RAIL_PRESSURES, SEAT, worn_case


@pytest.mark.parametrize("discrepancy", list(Discrepancy))
def test_wear_stands_still_and_every_second_case_changes_its_point(discrepancy: Discrepancy) -> None:
    points = []
    for number in (0, 1):
        events = worn_case(discrepancy, 5, number).bench.events
        assert len(events) == EVENTS
        (faults,) = {event.faults for event in events}
        assert 0.0 < abs(faults.orifice_area) <= NOZZLE
        assert 0.0 < abs(faults.seat_area) <= SEAT
        assert all(RAIL_PRESSURES[0] <= event.rail_pressure <= RAIL_PRESSURES[1] for event in events)
        assert all(DURATIONS[0] <= event.shots[0].duration <= DURATIONS[1] for event in events)
        points.append(len({event.rail_pressure for event in events}))
    assert points == [1, EVENTS]


def test_a_case_is_determined_by_its_number() -> None:
    one, same, other = (worn_case(Discrepancy.TAPER, 5, number).bench for number in (3, 3, 4))
    assert (one.seed, one.events) == (same.seed, same.events)
    assert one.seed != other.seed
