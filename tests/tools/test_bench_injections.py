"""First injections and others that nothing has taught: benches that differ as they say, and their figures."""

from dataclasses import replace

import numpy as np

from tests.plants.histories import Kind, bench_of, first_injections
from tests.plants.parameters import Faults
from tests.plants.plant import record
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
    assert row["samples_wrong"][0] <= row["samples"][0]
