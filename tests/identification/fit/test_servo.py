"""A healthy servo injector: its control flow is part of the fit, and of one that has none nothing is said."""

from functools import cache

import pytest

from observer_rt.identification.fit.calibrate import CalibrationResult, calibrate
from observer_rt.identification.fit.forms import CONTROL, DISPLACEMENT, OPTIONAL_GROUPS
from observer_rt.identification.likelihood.measurement import measurements
from tests.identification.fit.healthy import LUMPS, POINTS, of_independent_plant, off_by_ten_percent
from tests.plants.laws import Laws
from tests.plants.parameters import Injector
from tests.plants.plant import Needle

MM3_PER_MS, MICROSECOND = 1e-6, 1e-6


@cache
def fitted(laws: Laws, points: tuple[tuple[float, float], ...] = POINTS[:2] + POINTS[4:]) -> CalibrationResult:
    """To a recording a point of an independent plant, from numbers 10 % off and no control flow."""
    measured_recordings = measurements(of_independent_plant(Injector(), points, laws=laws))
    return calibrate(off_by_ten_percent(), measured_recordings, {}, lambda _: None, LUMPS[:1])


@pytest.mark.parametrize("flow", [1.5, pytest.param(8.0, marks=pytest.mark.slow)])
def test_its_control_flow_is_found(flow: float) -> None:
    laws = Laws(control_flow=flow * MM3_PER_MS)
    done = fitted(laws, POINTS)
    assert done.inadequate == ()
    size = done.sizes["line.control_flow"]
    assert size.value == pytest.approx(flow, abs=0.15)
    assert size.ci95[1] - size.ci95[0] < 0.4
    lift_off = 15e-6 / Needle().opening_speed  # s, after the needle has left its seat
    expected = (laws.control_lead + lift_off) / MICROSECOND
    assert done.sizes["line.control_start"].value == pytest.approx(expected, abs=12.0)
    assert done.injector.nozzle.flow_coefficient == pytest.approx(0.78, rel=3e-3)
    assert "line.displacement" not in done.sizes


@pytest.mark.parametrize("moves", [50.0, 250.0])
def test_a_needle_that_rises_into_its_chamber_does_not_change_the_level(moves: float) -> None:
    """What it displaces there leaves by the valve, quick or gradual, and does not come back as it falls."""
    done = fitted(Laws(control_flow=13e-6, chamber_inlet=10e-6, guide_area=7e-6, control_moves=1e-6 * moves), POINTS)
    assert done.inadequate == ()
    assert done.injector.nozzle.flow_coefficient == pytest.approx(0.78, rel=3e-3)  # 1.6 % more without it
    assert done.sizes["line.control_displacement"].ci95[0] > 2.0
    assert done.sizes["line.control_edge"].value == pytest.approx(0.4 * moves, rel=0.3)


def test_of_an_injector_without_any_nothing_is_said() -> None:
    done = fitted(Laws())
    assert done.inadequate == ()
    assert not done.sizes.keys() & {one.name for group in OPTIONAL_GROUPS for one in group}
    assert all(one.stated(done.injector) is None for one in (CONTROL[0], DISPLACEMENT))


def test_a_needle_that_displaces_fuel_has_no_control_flow() -> None:
    done = fitted(Laws(needle_area=1e-6))
    assert done.inadequate == ()
    assert done.sizes["line.displacement"].value == pytest.approx(1.0, abs=0.2)
    assert "line.control_flow" not in done.sizes
