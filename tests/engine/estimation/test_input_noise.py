"""Input noise through the open loop: against the same event run with many draws of it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.core.model.laws import seat_area_slope
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.predictor import Window, input_variance, open_loop
from tests.engine.estimation.conftest import NOISE, Case, event_inputs, simulated_event, worn_theta

DRAWS = 300
SILENT = NoiseLevels(0.0, 0.0, 0.0)
INTERVAL = 1e-5  # s


def noisy(case: Case, window: Window, noise: NoiseLevels, random: np.random.Generator) -> Window:
    """The window with other noise in its inputs, and in the output x~ follows up to the opening."""
    c = case.c
    inputs, n = window.inputs.copy(), window.output.size
    inputs[:, 0] += random.normal(0.0, noise.rail_pressure / c.pressure_scale, n)
    slope = np.array([seat_area_slope(float(a), c.seat) for a in inputs[:, 1]])
    inputs[:, 1] += slope / c.area_scale * random.normal(0.0, noise.needle_lift, n)
    output = window.output + random.normal(0.0, noise.line_pressure / c.pressure_scale, n)
    return window._replace(inputs=inputs, output=output)


@pytest.fixture(scope="module")
def event(nominal: Case) -> Window:
    """Opened and shut slowly, so that the lift matters for long."""
    inputs = event_inputs()
    time = np.arange(len(inputs)) * INTERVAL
    inputs[:, 1] = np.interp(time, [1.0e-3, 1.6e-3, 2.1e-3, 2.7e-3], [0.0, 0.8, 0.8, 0.0])
    return simulated_event(nominal, np.zeros_like(worn_theta()), inputs)


@pytest.mark.parametrize(
    ("noise", "tolerance"),
    [
        (replace(SILENT, rail_pressure=NOISE.rail_pressure, line_pressure=NOISE.line_pressure), 0.15),
        (replace(SILENT, needle_lift=NOISE.needle_lift), 0.2),
        (NOISE, 0.2),
    ],
    ids=["pressures", "lift", "all"],
)
def test_variances_are_those_of_many_draws(
    nominal: Case, event: Window, noise: NoiseLevels, tolerance: float
) -> None:
    random = np.random.default_rng(4)
    theta = worn_theta()
    run = open_loop(event, nominal.setting, theta)
    variance = input_variance(event, run, nominal.setting, noise)
    rates = np.array(
        [open_loop(noisy(nominal, event, noise, random), nominal.setting, theta).rate for _ in range(DRAWS)]
    )
    assert rms(np.sqrt(variance.rate)) == pytest.approx(rms(rates.std(axis=0)), rel=tolerance)
    volumes = np.trapezoid(rates, axis=1) * INTERVAL
    assert np.sqrt(variance.volume[-1]) == pytest.approx(volumes.std(), rel=tolerance)


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_twice_the_noise_is_twice_the_spread(nominal: Case, event: Window) -> None:
    run = open_loop(event, nominal.setting, worn_theta())
    once = input_variance(event, run, nominal.setting, NOISE)
    doubled = NoiseLevels(2 * NOISE.rail_pressure, 2 * NOISE.line_pressure, 2 * NOISE.needle_lift)
    twice = input_variance(event, run, nominal.setting, doubled)
    assert once.rate.max() > 0.0
    np.testing.assert_allclose(twice.rate, 4 * once.rate, rtol=1e-9)
    np.testing.assert_allclose(twice.volume, 4 * once.volume, rtol=1e-9)


def test_inputs_without_noise_leave_nothing_open(nominal: Case, event: Window) -> None:
    run = open_loop(event, nominal.setting, worn_theta())
    variance = input_variance(event, run, nominal.setting, SILENT)
    assert not variance.rate.any()
    assert not variance.volume.any()


def test_nothing_flows_and_nothing_is_uncertain_before_the_opening(nominal: Case, event: Window) -> None:
    run = open_loop(event, nominal.setting, worn_theta())
    variance = input_variance(event, run, nominal.setting, NOISE)
    assert not variance.rate[: event.opening].any()
    assert not variance.volume[: event.opening].any()


def test_volume_is_counted_from_the_last_opening(nominal: Case) -> None:
    """Two equal shots, the line at rest between them: what the first left open is not counted again."""
    shot = event_inputs(samples=1200)
    shot[:, 1] += np.roll(shot[:, 1], 600)
    window = simulated_event(nominal, np.zeros_like(worn_theta()), shot)
    run = open_loop(window, nominal.setting, np.zeros_like(worn_theta()))
    lift = replace(SILENT, needle_lift=NOISE.needle_lift)
    volume = input_variance(window, run, nominal.setting, lift).volume
    assert volume[600] > 0.0
    assert volume[-1] == pytest.approx(volume[600], rel=0.2)
