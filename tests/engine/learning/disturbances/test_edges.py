"""A step of the line pressure before every opening, found over the events; not where all of the standstill is odd."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.learning.disturbances.edges import (
    EdgeSearch,
    OtherColumns,
    edge_places,
    sums_at_rest,
    sums_beside_flow,
)

INTERVAL = 1e-5  # s
COUNT, OPENING = 400, 100
PLACES = edge_places(INTERVAL)
DELAY = 25  # samples before the opening


def response_from(first: int) -> NDArray[np.float64]:
    """Of the innovations to a step, which x~ slowly takes for its own."""
    k = np.arange(COUNT) - first
    return np.where(k >= 0, 0.95 ** np.maximum(k, 0), 0.0)


def at_rest(innovations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of an event in which nothing flows before the opening."""
    return sums_at_rest(innovations[:OPENING], response_from(OPENING - PLACES.longest)[:OPENING], PLACES)


def edges_found(events: int, height: float, unquiet: float = 0.0) -> list[bool]:
    """Event by event, with steps of a height and a swing at the same phase in all, in standard deviations."""
    search = EdgeSearch()
    result = []
    for seed in range(events):
        innovations = np.random.default_rng(seed).normal(size=COUNT)
        innovations += height * response_from(OPENING - DELAY)
        innovations += unquiet * np.sin(np.arange(COUNT) / 8.0)
        search = search.after(at_rest(innovations), 1.0)
        result.append(search.edge(PLACES) is not None)
    return result


@pytest.mark.parametrize(("height", "unsaid", "said"), [(0.7, 2, 12), (-0.7, 2, 12), (3.0, 1, 1)])
def test_a_step_below_the_noise_is_found_over_the_events(height: float, unsaid: int, said: int) -> None:
    """A large one as soon as it recurs."""
    result = edges_found(20, height)
    assert not any(result[:unsaid])
    assert all(result[said:])


def test_place_and_height_of_a_step_are_told() -> None:
    search = EdgeSearch()
    sigma = 2e-3
    for seed in range(30):
        innovations = np.random.default_rng(seed).normal(size=COUNT) + 1.5 * response_from(OPENING - DELAY)
        search = search.after(at_rest(innovations), sigma)
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
    for seed in range(20):
        innovations = np.random.default_rng(seed).normal(size=COUNT)
        innovations[OPENING - 3 :] -= 8.0
        if seed % 7 == 3:  # and once in a while by much
            innovations[OPENING - 20 :] -= 30.0
        search = search.after(at_rest(innovations), 1.0)
        assert search.edge(PLACES) is None


FLOW = np.where(np.arange(COUNT) > OPENING - 20, np.minimum(np.arange(COUNT) - OPENING + 20, 60) / 20.0, 0.0)


@pytest.mark.parametrize(("height", "flow"), [(1.5, 0.0), (-1.5, 3.0), (0.0, 3.0)])
def test_a_pulse_is_told_from_a_flow_that_begins_with_it(height: float, flow: float) -> None:
    search = EdgeSearch()
    other = OtherColumns.of(FLOW[:, np.newaxis], np.full(1, 10.0))
    pulse = response_from(OPENING - PLACES.longest) - response_from(OPENING + 200)
    for seed in range(12):
        signal = flow * FLOW + height * (response_from(OPENING - DELAY) - response_from(OPENING + 200))
        innovations = other.taken_from(np.random.default_rng(seed).normal(size=COUNT) + signal)
        search = search.after(sums_beside_flow(OPENING, innovations, pulse, other, PLACES), 1.0)
    edge = search.edge(PLACES)
    assert (edge is None) is (height == 0.0)
    if edge is not None:
        assert edge.before == pytest.approx(DELAY, abs=1)
        assert edge.height == pytest.approx(height, rel=0.15)
