"""First injections and others that nothing has taught: benches that differ as they say, and their figures."""

from dataclasses import replace

import numpy as np
import pytest

from tests.plants.histories import Kind, bench_of, first_injections
from tests.plants.laws import BY_DROP, BY_FLOW, BY_TIME, Laws
from tests.plants.parameters import Faults
from tests.plants.plant import record
from tests.plants.windows import true_masses
from tools.benchmarks.injections import score_history

POINT = (100e6, 0.9e-3)


def mass_share(kind: Kind, point: tuple[float, float] = POINT) -> float:
    """Mass of an injection of a kind, over that of a healthy injector."""
    kinds = (kind, Kind())
    benches = [bench_of(each, [point], 1) for each in kinds]
    changed, healthy = (float(true_masses(record(bench), bench)[0]) for bench in benches)
    return changed / healthy


@pytest.mark.parametrize(
    ("kind", "least", "most"),
    [
        (Kind(laws=Laws(root_coking=0.2)), 0.82, 0.9),
        (Kind(laws=Laws(seat_choking=0.5)), 0.95, 0.995),
        (Kind(laws=Laws(seat_choking=1.0)), 0.9999, 1.0001),
        (Kind(laws=Laws(seat_waves=0.5)), 0.9, 0.999),
        (Kind(laws=Laws(nozzle_product=0.5, second_factor=BY_TIME)), 0.9999, 1.0001),
        (Kind(laws=Laws(seat_product=-0.5, first_factor=BY_DROP, second_factor=BY_FLOW)), 0.9, 0.999),
    ],
)
def test_a_law_changes_the_mass(kind: Kind, least: float, most: float) -> None:
    assert least < mass_share(kind) < most


@pytest.mark.parametrize(("pressure", "sign"), [(60e6, -1), (140e6, 1)])
def test_a_product_goes_by_both_quantities(pressure: float, sign: int) -> None:
    law = Kind(laws=Laws(nozzle_product=0.3, second_factor=BY_TIME))
    assert sign * (mass_share(law, (pressure, 1.9e-3)) - 1.0) > 0.01
    assert sign * (mass_share(law, (pressure, 0.5e-3)) - 1.0) < -0.01


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
