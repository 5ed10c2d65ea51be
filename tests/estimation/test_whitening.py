"""The compiled filter against scipy's, and what it does to a level and to a slow wave."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.signal import lfilter

from observer_rt.estimation.whitening import LEVEL_SAMPLES, Whitening

TAPS = np.array([-0.8, 0.2, 0.05])


def noise(seed: int, *shape: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=shape)


def reference(values: NDArray[np.float64], whitening: Whitening) -> NDArray[np.float64]:
    """The same by scipy, for one column."""
    rest = values[1:]
    if whitening.forgetting is not None:
        rest = lfilter([1.0, -1.0], [1.0, -whitening.forgetting], rest - rest[:LEVEL_SAMPLES].mean())
    rest = lfilter(np.append(1.0, whitening.taps), [1.0], rest)
    return np.append(0.0, rest)


@pytest.mark.parametrize("forgetting", [None, 0.96])
@pytest.mark.parametrize("taps", [np.empty(0), TAPS])
@pytest.mark.parametrize("samples", [2, 3, 15, 400])
def test_as_scipy_filters(forgetting: float | None, taps: NDArray[np.float64], samples: int) -> None:
    whitening = Whitening(forgetting, taps)
    values = noise(1, samples, 4) + 3.0
    columns = [reference(values[:, j], whitening) for j in range(4)]
    assert_allclose(whitening.of(values), np.column_stack(columns), rtol=1e-12, atol=1e-12)
    assert_allclose(whitening.of(values[:, 2]), columns[2], rtol=1e-12, atol=1e-12)


def test_is_linear() -> None:
    whitening = Whitening(0.985, TAPS)
    one, other = noise(2, 300), noise(3, 300)
    assert_allclose(
        whitening.of(one - 2.0 * other), whitening.of(one) - 2.0 * whitening.of(other), atol=1e-12
    )


def test_a_level_passes_no_high_pass() -> None:
    assert_allclose(Whitening(0.985, TAPS).of(np.full(300, 5.0)), 0.0, atol=1e-12)
    assert_allclose(Whitening(None, np.empty(0)).of(np.full(300, 5.0))[1:], 5.0)
