"""The compiled filter against scipy's, and what it does to a level and to a slow wave."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.signal import lfilter

from observer_rt.core.learning.whitening import LEVEL_SAMPLES
from observer_rt.engine.learning.noise import Whitening

TAPS = np.array([-0.8, 0.2, 0.05])


def noise(seed: int, *shape: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=shape)


def reference(values: NDArray[np.float64], whitening: Whitening) -> NDArray[np.float64]:
    """The same by scipy, for one column."""
    remaining = values[1:]
    if whitening.forgetting is not None:
        remaining = lfilter([1.0, -1.0], [1.0, -whitening.forgetting], remaining - remaining[:LEVEL_SAMPLES].mean())
    remaining = lfilter(np.append(1.0, whitening.taps), [1.0], remaining)
    return np.append(0.0, remaining)


@pytest.mark.parametrize("forgetting", [None, 0.96])
@pytest.mark.parametrize("taps", [np.empty(0), TAPS])
@pytest.mark.parametrize("samples", [2, 3, 15, 400])
def test_as_scipy_filters(forgetting: float | None, taps: NDArray[np.float64], samples: int) -> None:
    whitening = Whitening(forgetting, taps)
    values = noise(1, samples, 4) + 3.0
    columns = [reference(values[:, j], whitening) for j in range(4)]
    assert_allclose(whitening.of(values), np.column_stack(columns), rtol=1e-12, atol=1e-12)
    assert_allclose(whitening.of(values[:, 2]), columns[2], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("forgetting", [None, 0.96])
def test_what_is_masked_does_not_matter_and_soon_is_forgotten(forgetting: float | None) -> None:
    whitening, values = Whitening(forgetting, TAPS), noise(4, 400)
    masked = np.zeros(400, np.bool_)
    masked[100:112] = True
    other = np.where(masked, 50.0, values)
    result = whitening.of(values, masked)
    assert_allclose(whitening.of(other, masked), result, rtol=1e-12)
    assert_allclose(result[100 : 112 + TAPS.size], 0.0, atol=1e-12)
    assert_allclose(result[:100], whitening.of(values)[:100], rtol=1e-12)
    if forgetting is None:
        assert_allclose(result[112 + TAPS.size :], whitening.of(values)[112 + TAPS.size :], rtol=1e-12)


def test_of_coloured_noise_with_a_gap_white_noise_is_left() -> None:
    """A gap taken for values of 0 would leave what the filter made of their loss."""
    whitening = Whitening(0.985, TAPS)
    white = noise(5, 4000)
    coloured = lfilter([1.0, -0.985], [1.0, -1.0], lfilter([1.0], np.append(1.0, TAPS), white))
    masked = np.zeros(white.size, np.bool_)
    for start in range(200, white.size, 200):
        masked[start : start + 12] = True
    result = whitening.of(np.where(masked, 0.0, coloured), masked)
    counted = result != 0.0
    assert counted.sum() > 0.85 * white.size
    assert np.std(result[counted]) == pytest.approx(np.std(white), rel=0.05)
