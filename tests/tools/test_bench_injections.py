"""First injections and others that nothing has taught: benches that differ as they say, and their figures."""

from dataclasses import replace

import numpy as np

from tests.plants.histories import CYCLE_PRESSURES, MAINS, SMALL, Kind, bench_of, driving_cycles, first_injections
from tests.plants.parameters import Faults
from tests.plants.plant import record
from tests.plants.windows import BINS, sample_facts
from tools.benchmarks.injections import score_history

POINT = (100e6, 0.9e-3)


def test_a_late_lift_is_recorded_late() -> None:
    bench = bench_of(Kind(), [POINT], 1)
    late = bench_of(Kind(late=60e-6), [POINT], 1)
    on_time, measured = (record(replace(each, noise=0.0)).measured.needle_lift for each in (bench, late))
    np.testing.assert_allclose(measured[6:], on_time[:-6], atol=2e-8)


def test_the_first_injection_of_a_worn_nozzle_is_scored_against_the_truth() -> None:
    worn = next(each for each in first_injections(1) if each.kind == "nozzle +30 %")
    assert worn.bench.events[0].faults == Faults(orifice_area=0.3)
    row = score_history("first", worn.name, 1, None, None)
    assert len(row["valid"]) == len(row["all_error_pct"]) == len(row["rmse"]) == 1
    assert row["error_pct"] == (row["all_error_pct"] if row["valid"][0] else [])
    assert len(row["refused"]) == (not row["valid"][0])
    assert -40.0 < row["live_error_pct"][0] < 10.0
    assert len(row["valid_wrong"]) >= sum(row["valid_wrong"])


def test_a_driving_cycle_has_no_operating_point_twice() -> None:
    for history in driving_cycles(1):
        events = history.bench.events
        points = [(event.rail_pressure, *(shot.duration for shot in event.shots)) for event in events]
        assert len({*points}) == len({pressure for pressure, *_ in points}) == len(events)
        assert CYCLE_PRESSURES[0] <= min(points)[0] < 50e6 < 160e6 < max(points)[0] <= CYCLE_PRESSURES[1]
        assert all(SMALL[0] <= duration <= MAINS[1] for _, *durations in points for duration in durations)
        assert {len(durations) for _, *durations in points} == {1, 2, 3}


def test_a_valid_sample_is_wrong_beyond_3_percent_of_what_flows() -> None:
    since, true = 1e-4 * np.arange(8.0), np.array([0.0, 4.0, 6.0, 10.0, 10.0, 10.0, 6.0, 2.0])
    live = true * np.array(
        [9.0, 9.0, 1.02, 1.04, 0.96, 1.0, 1.1, 9.0]
    )  # what is below half of the largest counts not
    valid = np.array([True, True, True, True, False, True, True, True])
    facts = sample_facts(since, valid, true, {"live": live, "open_loop": true})
    assert facts["valid_wrong"] == [0.0, 1.0, 0.0, 1.0]
    assert facts["settled_valid"] == [1.0, 0.0, 1.0, 1.0]
    by_time = [facts[f"live_from_{1e6 * begin:.0f}_us"] for begin in BINS[:-1]]
    assert by_time[1] == [2.0]
    assert [len(errors) for errors in by_time] == [2, 1, 3, 2, 0]
    assert set(facts["open_loop_from_300_us"]) == {0.0}
