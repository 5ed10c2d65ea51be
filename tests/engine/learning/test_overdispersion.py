"""Scatter of events beyond noise is estimated, and a single large change is no scatter."""

import numpy as np
import pytest

from observer_rt.engine.estimation.prediction_error import Linearisation
from observer_rt.engine.learning import account

EVENTS = 400
SIZE = 13  # parameters, all well determined by one event


def scores(factor: float, seed: int = 1) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Scores (EVENTS,) of events that scatter by a factor more than an exact model says."""
    return factor * account.USUAL_SCORE * np.random.default_rng(seed).chisquare(SIZE, EVENTS) / SIZE


@pytest.mark.parametrize("factor", [0.8, 1.0, 2.0, 4.0])
def test_the_factor_of_steady_events_is_found(factor: float) -> None:
    followed = account.Overdispersion()
    for score in scores(factor):
        followed = followed.after(score / followed.factor)
    assert followed.factor == pytest.approx(max(factor, 1.0), rel=0.25)


def test_the_fit_is_believed_until_events_say_otherwise() -> None:
    followed = account.of_healthy(3.0)
    assert followed.factor == 3.0
    for score in scores(1.0):
        followed = followed.after(score / followed.factor)
    assert followed.factor < 1.7


def test_a_change_of_the_injector_is_no_scatter() -> None:
    followed = account.Overdispersion()
    for score in scores(1.0)[:20]:
        followed = followed.after(score)
    followed = followed.after(5000.0)
    assert followed.factor < 1.2
    for _ in range(EVENTS):  # no change, but a model that is inadequate
        followed = followed.after(1e4)
    assert followed.factor == account.LARGEST


@pytest.mark.parametrize("factor", [1.0, 2.5])
def test_the_factor_of_known_events_makes_their_scores_the_usual_ones(factor: float) -> None:
    random = np.random.default_rng(5)
    information = np.diag(random.uniform(1e2, 1e4, SIZE))
    events = []
    for _ in range(100):
        spread = account.USUAL_SCORE * (factor + 0.1)
        gradient = np.sqrt(spread * np.diag(information)) * random.normal(size=SIZE)
        cost = Linearisation(np.zeros(SIZE), 0.0, gradient, information)
        covariance = np.diag(0.1 / np.diag(information))  # as sure as ten events make it
        events.append(account.TemperedEvent(cost, covariance))
    assert account.overdispersion_of(events) == pytest.approx(factor, rel=0.15)
