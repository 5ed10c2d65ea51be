"""Smooths beliefs over events: what was believed of each is revised by what later ones taught.

Fixed-interval smoothing: Rauch, Tung, Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA
Journal 3 (1965).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief, symmetric

_NARROWED = 1e-6  # share of a covariance, by which one event later may be less uncertain: rounding
_MOVED = 1.0  # standard deviations between events, beyond which a belief was not carried on but replaced

Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TaughtEvent:
    """Belief before an event, drift included, and after it."""

    prior: Belief
    after: Belief


def smoothed(events: Sequence[TaughtEvent]) -> list[Belief]:
    """Beliefs about each event by what all events taught; where a belief was replaced, by those on its own side.

    Raises numpy.linalg.LinAlgError when a covariance is singular.
    """
    result: list[Belief] = []
    ahead: _SmoothedEvent | None = None
    for event, following in zip(reversed(events), (None, *reversed(events)), strict=False):
        if ahead is None or following is None or not _goes_on(event.after, following.prior):
            ahead = _SmoothedEvent(
                event.after, np.eye(event.after.mean.size), np.zeros_like(event.after.covariance)
            )
        else:
            ahead = _before(event, following, ahead)
        result.append(ahead.belief)
    return result[::-1]


@dataclass(frozen=True, eq=False)
class _SmoothedEvent:
    """A smoothed belief; its error is kept (m, m) times that of the belief after the event, and one of later noise.

    later: covariance of that (m, m).
    """

    belief: Belief
    kept: Matrix
    later: Matrix


def _goes_on(after: Belief, prior: Belief) -> bool:
    """Whether a belief before an event is that after the one before it, perhaps less certain."""
    wider = prior.covariance - after.covariance
    if np.any(np.diag(wider) < -_NARROWED * np.diag(after.covariance)):
        return False
    return bool(np.all(np.abs(prior.mean - after.mean) <= _MOVED * prior.sigma))


def _before(event: TaughtEvent, following: TaughtEvent, ahead: _SmoothedEvent) -> _SmoothedEvent:
    """Belief about an event, by the smoothed one about that which follows it."""
    after, prior = event.after, following.prior
    gain = after.covariance @ prior.information
    covariance = after.covariance + gain @ (ahead.belief.covariance - prior.covariance) @ gain.T
    carried = following.after.covariance @ prior.information  # an error before the event, after it
    taught = following.after.information - prior.information
    noise = following.after.covariance @ taught @ following.after.covariance
    remainder = np.eye(after.mean.size) - ahead.kept @ carried
    kept = np.eye(after.mean.size) - gain @ remainder
    moved = prior.error_covariance - after.error_covariance
    later = (
        gain @ (ahead.kept @ noise @ ahead.kept.T + ahead.later + remainder @ moved @ remainder.T) @ gain.T
    )
    error = kept @ after.error_covariance @ kept.T + later
    mean = after.mean + gain @ (ahead.belief.mean - prior.mean)
    return _SmoothedEvent(Belief(mean, symmetric(covariance), symmetric(error)), kept, symmetric(later))
