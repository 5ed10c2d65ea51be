"""Few samples that stand out are spikes; many are not."""

import numpy as np
import pytest

from observer_rt.engine.learning.disturbances.masks import sharp_spikes_of, spikes_of

COUNT, FIRST = 1500, 50


@pytest.mark.parametrize("height", [-15.0, 15.0])
def test_innovations_that_leap_away_and_back_are_spikes(height: float) -> None:
    innovations = np.random.default_rng(2).normal(size=COUNT)
    innovations[400] += height
    innovations[700:705] += height
    assert spikes_of(innovations, 1.0, FIRST) == [(400, 401), (700, 705)]


def test_innovations_that_leap_and_stay_are_no_spike() -> None:
    innovations = np.random.default_rng(2).normal(size=COUNT)
    innovations[700:] += 20.0
    innovations[760:] += 20.0
    assert spikes_of(innovations, 1.0, FIRST) == []


@pytest.mark.parametrize("width", [1, 2, 3])
def test_spikes_that_leap_little_are_sharp(width: int) -> None:
    innovations = np.random.default_rng(4).normal(size=COUNT)
    assert sharp_spikes_of(innovations, 1.0, FIRST) == []
    innovations[600 : 600 + width] = -6.5
    assert sharp_spikes_of(innovations, 1.0, FIRST) == [(600, 600 + width)]


@pytest.mark.parametrize(
    ("where", "factor", "added"),
    [(slice(600, 620), 1.0, 4.0), (slice(None), 3.0, 0.0), (slice(100, None, 40), 0.0, 9.0)],
    ids=["what lasts", "too large everywhere", "many, of which the model is to blame"],
)
def test_what_is_not_sharp(where: slice, factor: float, added: float) -> None:
    innovations = np.random.default_rng(4).normal(size=COUNT)
    innovations[where] = factor * innovations[where] + added
    assert sharp_spikes_of(innovations, 1.0, FIRST) == []


def test_a_wrong_model_has_no_spikes() -> None:
    swing = 20.0 * np.sin(np.arange(COUNT) / 10.0)
    assert spikes_of(swing + np.random.default_rng(3).normal(size=COUNT), 1.0, FIRST) == []
