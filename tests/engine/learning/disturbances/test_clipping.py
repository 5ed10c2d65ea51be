"""A line pressure clipped before noise came on it: found by the model, masked, and forgotten when untrue."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.clipping import CLEAR, MARGIN, RECURS, EndsOfRange, pile_of
from observer_rt.engine.learning.disturbances.masks import Sigmas

NOISE = 0.0015  # of p_0
SIGMAS = Sigmas(innovation=1.2 * NOISE, noise=NOISE)
COUNT, OPENING, FIRST = 1500, 100, 50
UNMASKED = np.zeros(COUNT, np.bool_)


def truth(rail: float = 1.0) -> NDArray[np.float64]:
    """A line that swings after an injection, over the rail pressure and below it."""
    k = np.arange(COUNT) - OPENING
    swing = -0.1 * np.sin(2.0 * np.pi * k / 80.0) * np.exp(-k / 600.0)
    return rail + np.where(k > 0, swing, 0.0)


def event(level: float, sign: float, seed: int, rail: float = 1.0) -> tuple[Window, NDArray[np.float64]]:
    """A window clipped at a level [p_0], with sign -1 from below; and innovations of a right model."""
    y = truth(rail)
    y = np.minimum(y, level) if sign > 0 else np.maximum(y, level)
    y = y + np.random.default_rng(seed).normal(size=COUNT) * NOISE
    inputs = np.column_stack([np.full(COUNT, rail), np.zeros(COUNT)])
    return Window(inputs, y, UNMASKED, np.zeros(4), OPENING), y - truth(rail)


def seen(
    ends: EndsOfRange, window: Window, innovations: NDArray[np.float64]
) -> tuple[EndsOfRange, NDArray[np.bool_]]:
    """The ends of the range after an event, and its masked samples."""
    ends, mask = ends.masked(window, innovations, SIGMAS, FIRST)
    return ends.after(window, SIGMAS), mask


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_clear_is_masked_in_its_first_event(sign: float) -> None:
    level = 1.0 + 0.06 * sign
    window, innovations = event(level, sign, seed=1)
    _, mask = seen(EndsOfRange(), window, innovations)
    clipped = sign * truth() > sign * level
    assert clipped[mask].mean() > 0.6
    assert mask[clipped].mean() > 0.95
    close = sign * (truth() - level) > -3.0 * NOISE
    widened = np.convolve(close, np.ones(2 * MARGIN + 1), "same") > 0.5
    assert not mask[~widened].any()


def test_what_is_little_is_masked_once_it_recurred() -> None:
    level = float(truth().max()) - 0.006
    ends = EndsOfRange()
    results = []
    for seed in range(8):
        window, innovations = event(level, 1.0, seed)
        pile = pile_of(window.output, innovations, UNMASKED, SIGMAS, FIRST)
        assert pile is None or pile.changing < CLEAR
        ends, mask = seen(ends, window, innovations)
        results.append(bool(mask.any()))
    assert not any(results[:RECURS])
    assert results[-1]


def test_an_end_is_known_once_it_recurred() -> None:
    ends = EndsOfRange()
    are_known = []
    for seed in range(6):
        ends, _ = seen(ends, *event(1.06, 1.0, seed))
        are_known.append(ends.is_known)
    assert are_known == [number >= RECURS - 1 for number in range(6)]


def test_noise_on_a_right_model_is_no_end() -> None:
    ends = EndsOfRange()
    for seed in range(60):
        ends, mask = seen(ends, *event(9.0, 1.0, seed))
        assert not mask.any()
    assert not ends.is_known


@pytest.mark.parametrize("share", [0.7, 1.3])
def test_a_wrong_model_of_a_line_that_goes_on_is_no_end(share: float) -> None:
    """Its peaks are not flat, however far off the model is."""
    ends = EndsOfRange()
    for seed in range(20):
        window, innovations = event(9.0, 1.0, seed)
        wrong = innovations + 0.2 * (1.0 - share) * (truth() - 1.0)
        ends, mask = seen(ends, window, wrong)
        assert not mask.any()
    assert not ends.is_known


def test_below_an_end_nothing_is_masked_and_a_line_pressure_that_goes_beyond_it_has_none_there() -> None:
    ends = EndsOfRange()
    for seed in range(4):
        ends, _ = seen(ends, *event(1.06, 1.0, seed))
    assert ends.is_known
    _, mask = seen(ends, *event(1.06, 1.0, seed=9, rail=0.9))
    assert not mask.any()
    ends, _ = seen(ends, *event(9.0, 1.0, seed=9, rail=1.05))
    assert not ends.is_known


def test_a_pressure_at_rest_ends_nowhere() -> None:
    """A false opening: y rests, and only the model falls."""
    random = np.random.default_rng(3)
    ends = EndsOfRange()
    for _ in range(RECURS + 1):
        window, _ = event(2.0, 1.0, 0)
        window = window._replace(output=1.0 + random.normal(size=COUNT) * 0.2 * NOISE)
        ends, mask = seen(ends, window, window.output - truth())
        assert not mask.any()
    assert not ends.is_known


def test_an_end_that_an_event_passes_masks_nothing_of_it() -> None:
    level = float(truth().max()) - 0.006
    ends = EndsOfRange()
    for seed in range(8):
        ends, _ = seen(ends, *event(level, 1.0, seed))
    assert ends.is_known
    window, innovations = event(2.0, 1.0, 9, rail=1.1)
    _, mask = ends.masked(window, innovations, SIGMAS, FIRST)
    assert not mask.any()
