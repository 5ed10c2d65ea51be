"""What stated accuracies make of results that no pressure can tell."""

import math

import pytest
from pydantic import ValidationError

from observer_rt.config.bench import load_bench
from observer_rt.engine.service.injector import calibration_of
from observer_rt.model.accuracy import EXACT, EXACT_PARAMETERS, Accuracy, StatedAccuracy

BENCH = StatedAccuracy(0.007, 0.007, 0.01, 0.005, 0.005, 0.0)


def test_a_bore_known_to_a_percent_makes_four() -> None:
    assert 1.96 * StatedAccuracy(line_diameter=0.01).mass == pytest.approx(0.0392)
    assert 1.96 * BENCH.mass == pytest.approx(0.0416, abs=1e-4)
    assert BENCH.rate == pytest.approx(math.hypot(BENCH.mass, 0.005))


def test_the_gain_that_sensors_share_is_what_their_difference_leaves() -> None:
    """Of both gains by their difference: variances of a Gaussian conditioned on it."""
    line, rail = 0.004, 0.009
    stated = StatedAccuracy(line, rail)
    assert stated.common_gain**2 == pytest.approx(rail**2 - rail**4 / (line**2 + rail**2))
    assert stated.level(0.01) == pytest.approx(1.0 + 0.01 * rail**2 / (line**2 + rail**2))
    assert StatedAccuracy(line, 0.0).level(0.01) == 1.0


def test_a_control_flow_counts_by_what_it_is_of_an_injection() -> None:
    stated = StatedAccuracy.of(0.0, 0.0, Accuracy(line_diameter_percent=0.0, line_length_percent=0.0))
    assert stated.of_event(0.1).mass == pytest.approx(math.hypot(0.01, stated.mass))
    assert StatedAccuracy(measured=0.002, control_flow=0.1).of_event(0.1).mass == 0.002


def test_a_measured_mass_takes_the_place_of_geometry_and_gains() -> None:
    measured = StatedAccuracy.of(0.7, 0.7, Accuracy(mass_percent=0.2, fuel_density_percent=0.5))
    assert measured.is_calibrated
    assert measured.mass == pytest.approx(0.002)
    assert measured.rate == pytest.approx(math.hypot(0.002, 0.005))
    assert measured.as_text() == "level ±0.4 %, calibrated"
    with pytest.raises(ValidationError, match="line_diameter_percent"):
        Accuracy(mass_percent=0.2, line_diameter_percent=1.0)


def test_a_simulation_is_exact() -> None:
    exact = load_bench().exact.injector
    assert (calibration_of(exact), exact.parameters.accuracy) == (EXACT, EXACT_PARAMETERS)
    assert (EXACT.mass, EXACT.wear, EXACT.as_text(), EXACT.is_calibrated) == (0.0, 0.0, "", True)
    assert StatedAccuracy.of(0.7, 0.7, Accuracy()).wear > 0.02
