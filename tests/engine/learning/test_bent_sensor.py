"""A pressure sensor that is bent is right at some rail pressures: what it differs by at rest tells at the others."""

from dataclasses import replace
from itertools import accumulate

import numpy as np

from observer_rt.engine.stream.standstill import RestPoint, SensorSlope
from observer_rt.engine.stream.state import Reason
from tests.observed_plants import bench_at, observed
from tests.plants.histories import POINTS, WEAR, Kind, bench_of
from tests.plants.plant import LINE, Surroundings, seen_as

SHARP = (0.01e6) ** 2  # variance of a difference at rest
PRESSURES = [1e6 * p for p in (60, 60, 100, 140, 75, 120, 95, 150, 60, 130)]


def shares(differences: list[float], variance: float = SHARP) -> list[float]:
    """Of events at `PRESSURES`, whose pressures differ by so much at rest [Pa], beyond a gain that is known."""
    points = (RestPoint(p, 0.01 * p + each, variance) for p, each in zip(PRESSURES, differences, strict=True))
    slopes = accumulate(points, lambda slope, point: slope.after(point, 0.01), initial=SensorSlope())
    return [slope.share for slope in slopes][1:]


def test_no_mass_by_a_bent_sensor_is_valid_and_wrong() -> None:
    made = bench_of(Kind(), POINTS[::2] * 3, 3, "bent")
    bent = seen_as(LINE, lambda _, values: values + 0.06 * np.maximum(values - 90e6, 0.0))
    run = observed(replace(made, around=Surroundings(before_noise=(bent,))))
    off = np.abs(run.errors) > 0.03
    assert off[1:].sum() > 4  # the sensor does harm
    assert not (off & run.valid).any()
    assert all(Reason.PRESSURE_OFFSET in run.reports[event].reasons for event in np.flatnonzero(off))


def test_a_steady_injector_is_as_before_where_a_gain_may_be() -> None:
    run = observed(bench_of(Kind(WEAR[0]), [POINTS[3]] * 10, 5, "single"), bench_at(100e3, accuracy_percent=0.7))
    assert {report.posterior[0][0] for report in run.reports} == {"as before"}


def test_a_bend_shows_wherever_it_bends() -> None:
    seen = np.array(shares([0.06 * max(p - 90e6, 0.0) for p in PRESSURES]))
    assert (max(seen[:2]), min(seen[np.array(PRESSURES) > 95e6]) > 0.02) == (0.0, True)


def test_what_drifts_or_moved_once_is_not_bent() -> None:
    """A step shows at its own event, for it might be a bend; when it is over, all is as it was at other pressures."""
    assert max(shares([0.1e6 * np.sin(0.4 * k) for k in range(10)])) < 0.005
    seen = shares([0.5e6 * (4 <= k < 7) for k in range(10)])
    assert [share > 0.01 for share in seen] == [k == 4 for k in range(10)]


def test_noise_bends_no_sensor_and_no_rest_tells_nothing() -> None:
    assert max(shares(np.random.default_rng(1).normal(0.0, 0.3e6, 10).tolist(), 0.3e6**2)) < 0.01
    before = SensorSlope((RestPoint(60e6, 0.0, SHARP),), 0.02)
    assert before.after(RestPoint(100e6, 5e6, np.inf), 0.0) == before
