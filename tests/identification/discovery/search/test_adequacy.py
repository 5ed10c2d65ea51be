"""Residuals by signal, phase and operating point, and whether they are adequate."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.phases import Phase, phase_statistics
from observer_rt.engine.learning.healthy import healthy_for_naming
from observer_rt.identification.discovery.search.adequacy import healthy_of_fit, most_explained, worst
from observer_rt.identification.likelihood.signals import Pool, Signal
from observer_rt.model.baseline import HealthyRemainder, HealthyShape
from tests.baselines import WHITE
from tests.baselines import baseline as fitted

N = 5000


def _pool(scale: float = 1.0, shift: float = 0.0, phase: Phase = Phase.OPEN) -> Pool:
    phases = np.repeat(np.array([int(one) for one in Phase], np.int8), N)
    z: NDArray[np.float64] = np.random.default_rng(2).normal(size=phases.size)
    chosen = phases == phase
    z[chosen] = scale * z[chosen] + shift
    return {Signal.LINE_PRESSURE: phase_statistics(z, 1.0, phases, 0)}


def _remainder(variance: float) -> HealthyRemainder:
    left = WHITE | {"open": variance}
    nothing = dict.fromkeys(HealthyShape.model_fields, ())
    return HealthyRemainder.model_validate({"variance": left, "colour": left, "shape": nothing})


@pytest.mark.parametrize(
    ("phase", "scale", "shift"), [(Phase.OPENING, 1.3, 0), (Phase.AFTER, 1.3, 0), (Phase.OPEN, 1, 0.4)]
)
def test_a_phase_with_too_large_innovations_or_a_shift_is_named(phase: Phase, scale: float, shift: float) -> None:
    result = worst(_pool(scale=scale, phase=phase, shift=shift))
    assert result.phase is phase
    assert worst(_pool()).ratio <= 1.0 < result.ratio


def test_what_explains_an_open_needle_does_so_there_though_more_is_left_elsewhere() -> None:
    white = _pool()[Signal.LINE_PRESSURE]
    before, after = (
        {Signal.LINE_PRESSURE: replace(white, squares=white.squares * [1.0, 1.0, of_open, 1.0, of_after])}
        for of_open, of_after in ((3.0, 9.0), (1.0, 8.0))
    )
    assert most_explained(before, after) == (Phase.OPEN, Signal.LINE_PRESSURE)


def test_innovations_as_large_as_on_the_healthy_injector_are_adequate() -> None:
    baseline = healthy_for_naming(_remainder(1.4**2), adequate=True)
    assert worst(_pool(scale=1.4), baseline).ratio <= 1.0
    assert worst(_pool(scale=2.0), baseline).ratio > 1.0


def test_a_baseline_is_never_below_noise() -> None:
    assert healthy_for_naming(_remainder(0.25), adequate=True).variance[Phase.OPEN] == 1.0


def test_a_measured_rate_has_a_baseline_of_its_own() -> None:
    of_rate = {Signal.INJECTION_RATE: _pool(scale=1.4)[Signal.LINE_PRESSURE]}
    baseline = healthy_for_naming(_remainder(1.0), True, of_rate[Signal.INJECTION_RATE])
    assert worst(of_rate, baseline).ratio <= 1.0
    assert worst(_pool(scale=1.4), baseline).ratio > 1.0


@pytest.mark.parametrize("comparable", [True, False])
def test_a_fitted_file_is_a_baseline(comparable: bool) -> None:
    left = WHITE | {"after": 1.96}
    of_file = fitted(variance=left, colour=left, healthy=_remainder(1.96))
    baseline = healthy_of_fit(of_file, comparable)
    explained, other = (Phase.OPEN, Phase.AFTER) if comparable else (Phase.AFTER, Phase.OPEN)
    assert baseline.adequate is comparable
    assert worst(_pool(scale=1.4, phase=explained), baseline).ratio <= 1.0
    assert worst(_pool(scale=1.4, phase=other), baseline).ratio > 1.0


def test_what_an_inadequate_fit_leaves_is_searched() -> None:
    """The healthy injector's remainder would explain it; the sensor's offset is no error."""
    left = _remainder(1.96).model_copy(update={"line_pressure_offset_MPa": -0.3})
    baseline = healthy_of_fit(fitted(adequate=False, variance=WHITE | {"open": 1.96}, healthy=left), True)
    assert not baseline.adequate
    assert worst(_pool(scale=1.4, phase=Phase.OPEN), baseline).ratio > 1.0
    assert baseline.line_pressure_offset_MPa == -0.3
    assert healthy_of_fit(fitted(healthy=left), comparable=False).line_pressure_offset_MPa == -0.3


def test_a_file_fitted_before_the_healthy_injector_was_kept_is_not_trusted() -> None:
    assert not healthy_of_fit(fitted(), comparable=True).adequate
