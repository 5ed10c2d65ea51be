"""Arrays as texts, put in again."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.daemon.array_texts import ArrayTexts


@given(size=st.integers(4, 30), seed=st.integers(0, 2**32), decades=st.integers(0, 6))
def test_a_covariance_stays_one_however_little_is_left_of_it(size: int, seed: int, decades: int) -> None:
    """And one array of several is kept once; vectors keep every bit."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(size, size)) * np.geomspace(1.0, 10.0**-decades, size)
    covariance = root @ root.T + 1e-13 * np.eye(size)
    vector, texts = random.normal(size=4 * size), ArrayTexts()
    said = json.loads(json.dumps(texts.take_out({"a": [covariance, vector], "b": covariance.copy(), "c": None})))
    assert len(texts.texts) == 2
    again = ArrayTexts(texts.texts).put_in(said)
    (first, same), second = again["a"], again["b"]
    np.testing.assert_array_equal(same, vector)
    np.testing.assert_array_equal(first, first.T)
    np.testing.assert_array_equal(first, second)
    np.linalg.cholesky(first)
    np.testing.assert_allclose(first, covariance, rtol=0.0, atol=1e-6 * np.abs(covariance).max())


def test_an_array_that_is_not_finite_is_not_kept() -> None:
    with pytest.raises(ValueError, match="not finite"):
        ArrayTexts().take_out({"a": np.full((5, 5), np.inf)})
