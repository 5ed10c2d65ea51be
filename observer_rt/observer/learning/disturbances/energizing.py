"""Whether the coil's current couples into the line pressure: the step before the openings, and what follows of it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.prediction_error import EventCost
from observer_rt.estimation.predictor import Window
from observer_rt.observer.learning.disturbances.coil_current import CoilCurrent
from observer_rt.observer.learning.disturbances.edges import EdgeSearch, with_step
from observer_rt.observer.learning.fitting import EventFit


class Energizing:
    """Follows it event after event, and takes it out of events once it is known."""

    def __init__(self, interval: float, prior: NDArray[np.float64]) -> None:
        """interval: of samples [s]; prior: standard deviations (m,) of theta before any event."""
        self._prior = prior
        self._edges = EdgeSearch(interval)
        self._current = CoilCurrent(interval)

    @property
    def is_known(self) -> bool:
        """Whether it is taken out."""
        return self._current.pulse is not None

    @property
    def covariance(self) -> NDArray[np.float64] | float:
        """Of theta (m, m), by what is not known of what is taken out."""
        return self._current.covariance

    def undone(self, window: Window) -> Window:
        """A window without it."""
        return self._current.undone(window)

    def is_disturbing(
        self, window: Window, fit: EventFit, sigma: float, cost_of: Callable[[Window], EventCost]
    ) -> bool:
        """Take in a fitted event as it was recorded; whether something was in it that was not taken out.

        sigma: of the innovations [p_0]; cost_of: a window's cost.
        """
        first = window.opening - self._edges.longest
        if first <= 0:
            return False
        theta = fit.linearisation.theta

        def left(window: Window) -> NDArray[np.float64]:
            """Innovations in standard deviations, at the fit."""
            cost = cost_of(window)
            cost.value(theta)
            counts = cost.innovations / sigma
            counts[: cost.burn_in] = 0.0
            return counts

        shut = window.until(window.opening)
        before = left(shut)
        response = left(with_step(shut, first, sigma)) - before
        edge = self._edges.found_after(shut, sigma * before, response, sigma)
        was_known = self.is_known
        if edge is None:
            self._current.forget()
            return was_known
        self._current.take_in(window, edge, left, fit.slopes / sigma, self._prior)
        return not was_known
