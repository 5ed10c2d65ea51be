"""A window whose lift is moved: the lift on straight lines through samples and knots, at other times."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Window

SAMPLES, SHUT = 40, 12


def straight_lines(window: Window, at: float) -> float:
    points = [(float(k), float(area)) for k, area in enumerate(window.inputs[:, 1])]
    points += [(k + share, area) for k, (share, area) in enumerate(window.knots.tolist()) if share]
    points.sort()
    before = max((point for point in points if point[0] <= at), default=points[0])
    after = min((point for point in points if point[0] >= at), default=points[-1])
    if before[0] >= after[0]:
        return before[1]
    return before[1] + (after[1] - before[1]) * (at - before[0]) / (after[0] - before[0])


@st.composite
def windows(draw: st.DrawFn) -> Window:
    """A needle that opens after some shut samples, its lift sampled between the samples or not."""
    areas = np.zeros(SAMPLES)
    shares = st.floats(0.01, 1.0)
    areas[SHUT:-SHUT] = draw(st.lists(shares, min_size=SAMPLES - 2 * SHUT, max_size=SAMPLES - 2 * SHUT))
    knots: NDArray[np.float64] = np.empty((0, 2))
    if draw(st.booleans()):
        knots = np.zeros((SAMPLES, 2))
        for k in draw(st.sets(st.integers(SHUT, SAMPLES - SHUT - 2))):
            knots[k] = draw(st.floats(0.05, 0.95)), draw(shares)
    inputs = np.column_stack((np.full(SAMPLES, 0.9), areas))
    return Window(inputs, np.arange(SAMPLES, dtype=float), np.arange(SAMPLES) < SHUT, np.zeros(4), SHUT, knots)


@given(windows(), st.integers(-8_000_000, 8_000_000).map(lambda millionths: millionths / 1e6))
def test_lift_is_that_of_the_straight_lines_at_another_time(window: Window, samples: float) -> None:
    moved = window.with_lift_earlier(samples)
    expected = [straight_lines(window, k + samples) for k in range(SAMPLES)]
    np.testing.assert_allclose(moved.inputs[:, 1], expected, atol=1e-9)
    assert moved.opening == np.argmax(moved.inputs[:, 1] > 1e-12)
    for k in np.flatnonzero(moved.knots[:, 0]):
        share, area = moved.knots[k]
        assert 0.0 < share < 1.0
        assert abs(area - straight_lines(window, k + share + samples)) < 1e-9
    np.testing.assert_array_equal(moved.inputs[:, 0], window.inputs[:, 0])
    np.testing.assert_array_equal(moved.output, window.output)


@given(windows(), st.integers(-8, 8))
def test_whole_samples_move_and_come_back(window: Window, samples: int) -> None:
    moved = window.with_lift_earlier(float(samples))
    np.testing.assert_array_equal(moved.inputs[:, 1], np.roll(window.inputs[:, 1], -samples))
    np.testing.assert_array_equal(np.flatnonzero(moved.resting), np.arange(SHUT - samples))
    back = moved.with_lift_earlier(float(-samples))
    np.testing.assert_array_equal(back.inputs, window.inputs)
    np.testing.assert_allclose(back.knots, window.knots, atol=1e-12)
