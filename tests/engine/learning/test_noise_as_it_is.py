"""The observer on recordings of an independent plant whose line pressure hums or has coloured noise."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.stream.state import State
from tests.engine.plant_runs import worn_bench
from tests.observed_plants import ObservedRun, bench_at, observed, recording_of
from tests.plants.filters import butterworth, coloured_noise, filtered
from tests.plants.plant import FIRST_EVENT, LINE, PERIOD, RAIL, SIGNALS, Step, record, seen_as

EVENTS = 9
INTERVAL = 1e-5  # s
SEED = 11
KNOWN_AFTER = 4  # events
ALL_VALID = [True] * (EVENTS - KNOWN_AFTER)
Noise = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def hum(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return 0.5e6 * np.sin(2.0 * math.pi * 47.0 * time)


def coloured(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return coloured_noise(np.random.default_rng(3).normal(0.0, 0.2e6, time.size), INTERVAL, 3e3)


def added(noise: Noise, role: str = LINE) -> Step:
    return seen_as(role, lambda time, values: values + noise(time))


def seen(*steps: Step) -> ObservedRun:
    return observed(worn_bench(EVENTS, SEED, *steps))


@pytest.mark.parametrize("disturbance", [hum, coloured])
def test_masses_are_right_and_valid(disturbance: Noise) -> None:
    run = seen(added(disturbance))
    assert run.valid[KNOWN_AFTER:] == ALL_VALID
    assert np.abs(run.errors[KNOWN_AFTER:]).max() < 0.01
    assert sum(run[KNOWN_AFTER:].inside) >= EVENTS - KNOWN_AFTER - 1


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_masses_are_right_from_the_first_one_where_the_line_pressure_reaches_an_end_of_its_range(sign: float) -> None:
    """What lies beyond is left out, and differs from a needle or a nozzle in that it stays where it is."""

    def clipped(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return sign * np.minimum(sign * values, np.max(sign * values) - 3e6)

    run = seen(seen_as(LINE, lambda time, values: clipped(values)))
    assert all(run.valid)
    assert np.abs(run.errors).max() < 0.01


def test_hum_does_not_hide_a_line_pressure_that_went_elsewhere() -> None:
    """The watch expects the hum, and no more than that; the event then tells that it is the sensor."""
    run = seen(added(hum), added(lambda time: np.where(time > time[-1] - 0.1, 3e6, 0.0)))
    last = run.reports[-1]
    assert last.state is State.DEGRADED
    assert last.posterior[0][0] == "sensor changed"
    assert abs(run.errors[-1]) < 0.01


def test_what_was_learned_of_the_noise_holds_where_learning_is_off() -> None:
    humming = recording_of(record(worn_bench(EVENTS, SEED, added(hum))))
    learned = evaluate(bench_at(100e3), [humming]).knowledge
    assert learned.state.learned.colour is not None
    white = replace(learned, state=learned.state.map(lambda each: replace(each, colour=None)))

    def valid(knowledge: Knowledge) -> list[bool]:
        reports = evaluate(bench_at(100e3), [humming], knowledge, learning=False).evaluations[0].reports
        return [report.valid for report in reports[KNOWN_AFTER:]]

    assert valid(learned) == ALL_VALID
    assert not any(valid(white))


@pytest.mark.parametrize("after", [-10e-3, 0.0, 10e-3])
def test_a_noise_that_grows_costs_two_events(after: float) -> None:
    """That in which it does, and the next at most: what was judged by another noise says nothing."""
    random = np.random.default_rng(5)

    def late(size: float) -> Noise:
        since = FIRST_EVENT + 4 * PERIOD + after
        return lambda time: np.where(time > since, random.normal(0.0, size, time.size), 0.0)

    run = seen(added(late(0.28e6), RAIL), added(late(0.42e6)))
    assert run.valid[3:].count(False) <= 2


def test_all_channels_through_an_anti_alias_filter() -> None:
    """Neighbours differ little then: by their differences the noise is a tenth of what it is."""
    slow = butterworth(2, 10e3)
    run = seen(*(seen_as(role, lambda _, values: filtered(values, INTERVAL, slow)) for role in SIGNALS))
    assert run.valid[KNOWN_AFTER:] == ALL_VALID
