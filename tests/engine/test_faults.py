"""Line and sensor faults on a plant that shares no code with the observer: set apart from wear, named, or refused."""

import pytest

from observer_rt.engine.estimation.parameters import NOZZLE, OFFSET, SEAT
from observer_rt.engine.stream.state import Reason
from tests.engine.plant_runs import EVENTS, GATED, HEALTHY, indicator, run_plant
from tests.observed_plants import ObservedRun
from tests.plants.parameters import Faults

FAULTS = {
    "line friction x 3": ("line_friction", 2.0),
    "leak": ("guide_leakage", 3e-14),
    "stiffer line": ("bulk_modulus", 0.2),
    "softer line": ("bulk_modulus", -0.2),
    "sensor lag": ("line_pressure_sensor_lag", 40e-6),
    "line offset": (OFFSET, 0.8e6),
    "entrained air": ("entrained_air", 4e-3),
}


def check_well_estimated(run: ObservedRun) -> None:
    assert abs(run[5:].error) <= 0.006
    assert all(report.valid for report in run.reports[5:])
    assert abs(indicator(run, NOZZLE).value) < 0.015
    assert abs(indicator(run, SEAT).value) < 0.03


def test_healthy_injector_names_nothing() -> None:
    run = run_plant(HEALTHY)
    check_well_estimated(run)
    assert all(indicator(run, name).value == 0.0 for name in GATED)
    assert abs(indicator(run, OFFSET).value) < 0.02e6
    assert all(run.valid)


@pytest.mark.parametrize(("name", "true"), FAULTS.values(), ids=FAULTS)
def test_fault_is_named_and_the_mass_is_right(name: str, true: float) -> None:
    run = run_plant(Faults(**{name: true}))
    check_well_estimated(run)
    estimate = indicator(run, name)
    assert estimate.value == pytest.approx(true, rel=0.15)
    assert estimate.sigma is not None
    assert abs(estimate.value - true) < max(6 * estimate.sigma, 0.02 * abs(true))
    others = GATED - {name}
    assert all(indicator(run, other).value == 0.0 for other in others)


@pytest.mark.parametrize(
    ("nozzle", "seat", "offset"), [(0.3, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.2, 0.0, -1e6)]
)
def test_wear_is_told_from_an_offset_of_the_line_sensor(nozzle: float, seat: float, offset: float) -> None:
    run = run_plant(Faults(orifice_area=nozzle, seat_area=seat, line_pressure_sensor_offset=offset))
    assert abs(run[3:].error) <= 0.01
    for name, true, apart in ((NOZZLE, nozzle, 0.02), (SEAT, seat, 0.1), (OFFSET, offset, 0.03e6)):
        assert indicator(run, name).value == pytest.approx(true, abs=apart)
    sigmas = [report.indicators[NOZZLE].sigma for report in (run.reports[0], run.reports[-1])]
    assert sigmas[0] is not None
    assert sigmas[1] is not None
    assert sigmas[1] < 0.7 * sigmas[0]


@pytest.mark.parametrize("offset", [3e6, -3e6])
def test_rail_offset_beyond_a_good_sensor_is_refused(offset: float) -> None:
    """From p_L alone a rail offset is the line sensor's with the other sign: the level of Q_H hangs on which."""
    run = run_plant(Faults(rail_pressure_sensor_offset=offset))
    assert not any(report.valid for report in run.reports)
    assert Reason.PRESSURE_OFFSET in {report.reason for report in run.reports[2:]}
    assert indicator(run, OFFSET).value == pytest.approx(-offset, rel=0.15)


@pytest.mark.parametrize("name", ["healthy", *FAULTS])
def test_interval_holds_the_true_mass(name: str) -> None:
    """Of 95 % intervals, at most two in eight may miss: that happens once in 180 such runs."""
    run = run_plant(HEALTHY if name == "healthy" else Faults(**dict([FAULTS[name]])))
    held = 0
    for report, true in zip(run.reports[2:], run.true[2:], strict=True):
        assert 0.0 < report.mass_bound < 0.02 * true
        held += abs(report.mass - true) <= report.mass_bound
    assert held >= EVENTS - 2 - 2
