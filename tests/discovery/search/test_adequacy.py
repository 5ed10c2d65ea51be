"""Residuals by signal, phase and operating point, and whether they are adequate."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.discovery.search.adequacy import (
    NO_BASELINE,
    HealthyBaseline,
    baseline_of,
    baseline_of_fit,
    worst,
)
from observer_rt.estimation.phases import Phase, phase_statistics
from observer_rt.evidence.pooled import Pool, Signal
from observer_rt.model.baseline import Baseline

N = 5000


def _pool(scale: float = 1.0, shift: float = 0.0, phase: Phase = Phase.OPEN) -> Pool:
    """White innovations in all phases, in one of them scaled and shifted."""
    phases = np.repeat(np.array([int(one) for one in Phase], np.int8), N)
    z: NDArray[np.float64] = np.random.default_rng(2).normal(size=phases.size)
    chosen = phases == phase
    z[chosen] = scale * z[chosen] + shift
    return {Signal.LINE_PRESSURE: phase_statistics(z, 1.0, phases, 0)}


def test_white_innovations_are_adequate() -> None:
    assert worst(_pool()).ratio <= 1.0


@pytest.mark.parametrize("phase", [Phase.OPENING, Phase.AFTER])
def test_what_is_too_large_is_found_where_it_is(phase: Phase) -> None:
    found = worst(_pool(scale=1.3, phase=phase))
    assert found.phase is phase
    assert found.ratio > 1.0


def test_a_small_lasting_shift_shows_in_the_means_of_blocks() -> None:
    found = worst(_pool(shift=0.4))
    assert found.phase is Phase.OPEN
    assert found.ratio > 1.0


def test_what_healthy_recordings_leave_is_adequate_again() -> None:
    baseline = baseline_of(_pool(scale=1.4))
    assert worst(_pool(scale=1.4), baseline).ratio <= 1.0
    assert worst(_pool(scale=2.0), baseline).ratio > 1.0


def test_a_baseline_is_never_below_noise() -> None:
    assert baseline_of(_pool(scale=0.5)).variance[Signal.LINE_PRESSURE, Phase.OPEN] == 1.0


def test_no_baseline_is_trusted_and_gains_nothing() -> None:
    assert HealthyBaseline({}, {}) == NO_BASELINE
    assert NO_BASELINE.trusted
    assert NO_BASELINE.gain == 0.0


@pytest.mark.parametrize("adequate", [True, False])
def test_a_fitted_file_is_a_baseline(adequate: bool) -> None:
    left = dict.fromkeys(("standstill", "opening", "open", "closing", "after"), 1.0)
    of_file = Baseline.model_validate(
        {
            "adequate": adequate,
            "level": "file",
            "mass_share": 0.002,
            "sample_rate_Hz": 1e5,
            "injections": 36,
            "rail_pressure_MPa": (60.0, 140.0),
            "variance": left | {"open": 1.96},
            "chi2": left,
            "colour": left | {"open": 1.96},
            "noise": {"rail_pressure_MPa": 0.1, "line_pressure_MPa": 0.15, "needle_lift_um": 0.4},
        }
    )
    baseline = baseline_of_fit(of_file)
    assert baseline.trusted is adequate
    assert worst(_pool(scale=1.4), baseline).ratio <= 1.0
    assert worst(_pool(scale=1.4, phase=Phase.AFTER), baseline).ratio > 1.0
