"""Standstill: what the shut needle says of sensors and line."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.identification.discovery.standstill import StandstillFigure, standstill_checks
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.model.effects import sized
from tests.identification.discovery.conftest import Worn
from tests.identification.discovery.hidden import MODEL, recordings


def _checks(results: tuple[Measurement, ...]) -> list[StandstillFigure]:
    return list(standstill_checks(results, joint_likelihood(results, MODEL), MODEL, MODEL))


def _named(checks: list[StandstillFigure], name: str) -> list[StandstillFigure]:
    return [check for check in checks if check.id == name]


def test_a_worn_injector_stands_still_as_a_new_one(worn: Worn) -> None:
    checks = worn.findings.checks
    assert all(check.passed for check in checks)
    assert all(lag.sigma < 1.0 for lag in checks if lag.id == "apparent_line_pressure_sensor_lag")
    noise = {check.id: check.value for check in checks if check.recording == 0}
    assert noise["rail_pressure_noise"] == pytest.approx(0.10, rel=0.05)
    assert noise["line_pressure_noise"] == pytest.approx(0.15, rel=0.05)
    assert noise["needle_lift_noise"] == pytest.approx(0.4, rel=0.2)
    assert noise["injection_rate_noise"] == pytest.approx(0.5, rel=0.05)


def test_an_offset_is_measured_and_flagged() -> None:
    checks = _checks(measurements(recordings((sized("line_pressure_sensor_offset", o=0.5e6),))))
    for check in _named(checks, "rail_line_offset"):
        assert check.value == pytest.approx(0.5, abs=5 * check.sigma)
        assert check.sigma < 0.05
        assert not check.passed


def test_a_slow_sensor_shows_beside_the_model() -> None:
    checks = _checks(measurements(recordings((sized("line_pressure_sensor_lag", tau=20e-6),))))
    (lag,) = _named(checks, "apparent_line_pressure_sensor_lag")
    assert lag.value == pytest.approx(20.0, rel=0.2)
    assert lag.recording is None
    assert not lag.passed


def test_a_sinking_pressure_is_a_slope() -> None:
    sinking = [replace(each, line_pressure=each.line_pressure - 30e6 * each.time) for each in recordings()]
    checks = _checks(measurements(sinking))
    for check in _named(checks, "line_pressure_slope"):
        assert check.value == pytest.approx(-30.0, abs=5 * check.sigma)
        assert not check.passed


def test_an_open_needle_at_the_cut_end_is_no_standstill() -> None:
    (first, *_) = recordings()
    lift = first.needle_lift.copy()
    lift[-2000:] = 0.2e-3
    line = first.line_pressure.copy()
    line[-2000:] += np.linspace(0, -40e6, 2000)
    (complete,) = _named(_checks(measurements([first])), "rail_line_offset")
    cut = measurements([replace(first, needle_lift=lift, line_pressure=line)])
    (check,) = _named(_checks(cut), "rail_line_offset")
    assert check.value == pytest.approx(complete.value, abs=5 * complete.sigma)
