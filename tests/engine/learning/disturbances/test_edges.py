"""A step of the line pressure before every opening, found over the events; not where all of the standstill is odd."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.coil_current import EdgeSearch, edge_places, with_step

INTERVAL = 1e-5  # s
COUNT, OPENING = 400, 100
PLACES = edge_places(INTERVAL)
DELAY = 25  # samples before the opening


def window() -> Window:
    return Window(np.zeros((COUNT, 2)), np.ones(COUNT), np.zeros(COUNT, np.bool_), np.zeros(4), OPENING)


def response_from(first: int) -> NDArray[np.float64]:
    """Of the innovations to a step, which x~ slowly takes for its own."""
    k = np.arange(COUNT) - first
    return np.where(k >= 0, 0.95 ** np.maximum(k, 0), 0.0)


def edges_found(events: int, height: float, unquiet: float = 0.0) -> list[bool]:
    """Event by event, with steps of a height and a swing at the same phase in all, in standard deviations."""
    search = EdgeSearch()
    response = response_from(OPENING - PLACES.longest)
    result = []
    for seed in range(events):
        innovations = np.random.default_rng(seed).normal(size=COUNT)
        innovations += height * response_from(OPENING - DELAY)
        innovations += unquiet * np.sin(np.arange(COUNT) / 8.0)
        search = search.after(window(), innovations, response, 1.0, PLACES)
        result.append(search.edge(PLACES) is not None)
    return result


@pytest.mark.parametrize("height", [0.7, -0.7])
def test_a_step_below_the_noise_is_found_over_the_events(height: float) -> None:
    said = edges_found(20, height)
    assert not any(said[:2])
    assert all(said[12:])


def test_a_large_step_is_found_as_soon_as_it_recurs() -> None:
    assert edges_found(4, 3.0) == [False, True, True, True]


def test_place_and_height_of_a_step_are_told() -> None:
    search = EdgeSearch()
    sigma = 2e-3
    response = response_from(OPENING - PLACES.longest)
    for seed in range(30):
        innovations = np.random.default_rng(seed).normal(size=COUNT) + 1.5 * response_from(OPENING - DELAY)
        search = search.after(window(), sigma * innovations, response, sigma, PLACES)
    edge = search.edge(PLACES)
    assert edge is not None
    assert edge.before == pytest.approx(DELAY, abs=1)
    assert edge.height == pytest.approx(1.5 * sigma, rel=0.1)


def test_noise_has_no_steps() -> None:
    assert not any(edges_found(300, 0.0))


def test_what_swings_at_standstill_is_no_edge() -> None:
    assert not any(edges_found(20, 0.0, unquiet=0.7))


def test_a_lift_that_is_recorded_late_is_no_edge() -> None:
    search = EdgeSearch()
    response = response_from(OPENING - PLACES.longest)
    for seed in range(20):
        innovations = np.random.default_rng(seed).normal(size=COUNT)
        innovations[OPENING - 3 :] -= 8.0
        if seed % 7 == 3:  # and once in a while by much
            innovations[OPENING - 20 :] -= 30.0
        search = search.after(window(), innovations, response, 1.0, PLACES)
        assert search.edge(PLACES) is None


def test_with_step_raises_the_line_pressure_from_a_sample_on() -> None:
    stepped = with_step(window(), 30, 0.5).output
    assert (stepped[:30] == 1.0).all()
    assert (stepped[30:] == 1.5).all()
