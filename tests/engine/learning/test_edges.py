"""A step of the line pressure before every opening, found over the events; not where all of the standstill is odd."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.learning.coil_current import EdgeSearch, edge_places, sums_at_rest

INTERVAL = 1e-5  # s
COUNT, OPENING = 400, 100
PLACES = edge_places(INTERVAL)
DELAY = 25  # samples before the opening


def response_from(first: int) -> NDArray[np.float64]:
    """Of the innovations to a step, which x~ slowly takes for its own."""
    k = np.arange(COUNT) - first
    return np.where(k >= 0, 0.95 ** np.maximum(k, 0), 0.0)


def searches(events: int, signal: Callable[[int], NDArray[np.float64]]) -> list[EdgeSearch]:
    """After every event in which nothing flows before the opening; signal: (n,) of an event by number, in noise."""
    response, result = response_from(OPENING - PLACES.longest)[:OPENING], [EdgeSearch()]
    for seed in range(events):
        innovations = np.random.default_rng(seed).normal(size=COUNT) + signal(seed)
        result.append(result[-1].after(sums_at_rest(innovations[:OPENING], response, PLACES)))
    return result[1:]


def edges_found(events: int, height: float, unquiet: float = 0.0) -> list[bool]:
    """Event by event, with steps of a height and a swing at the same phase in all, in standard deviations."""
    signal = height * response_from(OPENING - DELAY) + unquiet * np.sin(np.arange(COUNT) / 8.0)
    return [search.edge(PLACES) is not None for search in searches(events, lambda _: signal)]


@pytest.mark.parametrize(("height", "unsaid", "said"), [(0.7, 2, 12), (-0.7, 2, 12), (3.0, 1, 1)])
def test_a_step_below_the_noise_is_found_over_the_events(height: float, unsaid: int, said: int) -> None:
    """A large one as soon as it recurs."""
    result = edges_found(20, height)
    assert not any(result[:unsaid])
    assert all(result[said:])


def test_the_place_of_a_step_is_told() -> None:
    search = searches(30, lambda _: 1.5 * response_from(OPENING - DELAY))[-1]
    assert search.edge(PLACES) == pytest.approx(DELAY, abs=1)


@pytest.mark.parametrize(("events", "unquiet"), [(300, 0.0), (20, 0.7)])
def test_noise_and_what_swings_at_standstill_have_no_edge(events: int, unquiet: float) -> None:
    assert not any(edges_found(events, 0.0, unquiet))


def test_a_lift_that_is_recorded_late_is_no_edge() -> None:
    """And is once in a while recorded much later."""

    def late(event: int) -> NDArray[np.float64]:
        k = np.arange(COUNT) - OPENING
        return np.where(k >= -3, -8.0, 0.0) + np.where((k >= -20) & (event % 7 == 3), -30.0, 0.0)

    assert not any(search.edge(PLACES) for search in searches(20, late))
