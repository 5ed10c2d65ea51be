"""What the coil's current adds to the line pressure while it flows, taken out once it is known well enough.

Its beginning is a step at the same time before every opening. The needle is shut then and nothing moves, so the model
has nothing to say to it, however small it is; over many events it stands out of the noise. Its end lies in the
injection: it is sought where the events, all else fitted, are explained best. Until that is clear nothing is taken
out. Left in, it would be taken for wear.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.fitting import EventFit
from observer_rt.engine.learning.memory import Tracker

LONGEST_DELAY = 0.45e-3  # s, from the start of energizing to the opening
SHORTEST_DELAY = 0.12e-3
BEFORE_OPENING = (
    0.06e-3  # s that do not count: a lift that is recorded late lets the line pressure fall in them
)
EDGE_CLIP = 3.0  # standard deviations for which an innovation counts at most: one event alone is an outlier
SEEN_FOR = 0.25e-3  # s, until x~ has taken a step for its own
FEWEST = 2  # samples of it: at a low sample rate no edge is seen
STANDS_OUT = 4.5  # standard deviations
OF_ONE_EVENT = 4.0  # of these at most, so that it must recur
COMMON = 0.6  # of it, up to which steps may stand out that are no edge: then the standstill is not understood at all


@dataclass(frozen=True)
class Edge:
    """A step of a height [p_0] so many samples before the openings."""

    height: float
    before: int


class EdgeSearch(Tracker):
    """Looks for a step at one time before the openings, event after event."""

    _products: NDArray[np.float64]
    _squares: NDArray[np.float64]
    _whole: NDArray[np.float64]

    def __init__(self, interval: float) -> None:
        """interval: of samples [s]."""
        self._shortest, self.longest, self._seen_for, self._beside = (
            round(duration / interval)
            for duration in (SHORTEST_DELAY, LONGEST_DELAY, SEEN_FOR, BEFORE_OPENING)
        )
        self._seen_for = max(self._seen_for, FEWEST)
        places = self.longest + self._seen_for
        self._products, self._squares = np.zeros(places), np.zeros(places)
        self._whole = np.zeros((2, places))  # the same without limits: how high, and where

    def found_after(
        self, window: Window, innovations: NDArray[np.float64], response: NDArray[np.float64], sigma: float
    ) -> Edge | None:
        """Take in an event's innovations (n,); the step there is, None if there is none.

        response: (n,) of the innovations to a step of y at the sample `longest` before the opening.
        """
        self._products *= REMEMBERED
        self._squares *= REMEMBERED
        self._whole *= REMEMBERED
        opening = window.opening
        clipped = np.clip(innovations[:opening] / sigma, -EDGE_CLIP, EDGE_CLIP)
        shape = response[opening - self.longest : opening - self.longest + self._seen_for]
        products, squares = np.zeros((2, self._products.size))
        _compare(clipped, shape, self._shortest, self._beside, products, squares)
        most = OF_ONE_EVENT * np.sqrt(squares)
        self._products += np.clip(products, -most, most)
        self._squares += squares
        self._whole += products / sigma, squares / sigma**2
        known = np.maximum(self._squares, np.finfo(np.float64).tiny)
        scores = np.abs(self._products) / np.sqrt(known)
        edge, elsewhere = scores[: self.longest + 1].max(), scores[self.longest + 1 :].max()
        if not (edge > STANDS_OUT and elsewhere < COMMON * edge):
            return None
        products, squares = self._whole[:, : self.longest + 1]
        before = int(np.argmax(products**2 / np.maximum(squares, np.finfo(np.float64).tiny)))
        return Edge(float(products[before] / squares[before]), before)


def _compare(
    innovations: NDArray[np.float64],
    shape: NDArray[np.float64],
    shortest: int,
    beside: int,
    products: NDArray[np.float64],
    squares: NDArray[np.float64],
) -> None:
    """Products of innovations with a shape that begins so many samples before their end, and its squares.

    For every place of `products` and `squares` from the `shortest` on; `beside` the end nothing counts.
    """
    n = innovations.size
    of_shape = np.cumsum(shape**2)
    for place in range(shortest, min(products.size, n)):
        length = min(place - beside, shape.size)
        if length > 0:
            products[place] += innovations[n - place : n - place + length] @ shape[:length]
            squares[place] += of_shape[length - 1]


def with_step(window: Window, first: int, height: float) -> Window:
    """A window with a step of the line pressure [p_0] from sample `first` on."""
    output = window.output.copy()
    output[first:] += height
    return window._replace(output=output)


EARLIEST_END, LATEST_END = 0.65e-3, 0.05e-3  # s before the closing
END_STEP = 0.05e-3  # s from one end that is tried to the next
REMEMBERED = 0.95  # weight of the events before an event
CLEAR = 9.0  # chi2 / 2 by which an end must be better than those that are not beside it: more than four sigma
BEFORE_KNOWN = (
    0.02  # weight of events that were fitted with the pulse: it was taken for something else in part
)
SHAPE = 0.05  # of its height, by which it is no rectangle
CLIP = 4.0  # standard deviations for which an innovation counts at most

Innovations = Callable[[Window], NDArray[np.float64]]


@dataclass(frozen=True)
class CoilPulse:
    """Of a height [p_0], from so many samples before every opening until so many before its closing."""

    height: float
    before: int
    until: int

    def taken_out(self, window: Window) -> Window:
        """A window without it."""
        output = window.output.copy()
        is_open = np.concatenate(([False], window.inputs[:, 1] > 0.0, [False]))
        edges = np.flatnonzero(np.diff(is_open))
        for opening, shut in zip(edges[::2], edges[1::2], strict=True):
            output[max(opening - self.before, 0) : max(shut - self.until, opening)] -= self.height
        return window._replace(output=output)


class CoilCurrent(Tracker):
    """Seeks the end of the pulse over the events, and takes the pulse out of those that follow."""

    _products: NDArray[np.float64]
    _squares: NDArray[np.float64]
    pulse: CoilPulse | None
    covariance: NDArray[np.float64]

    def __init__(self, interval: float, width: int) -> None:
        """interval: of samples [s]; width: columns of theta."""
        earliest, latest, step = (round(t / interval) for t in (EARLIEST_END, LATEST_END, END_STEP))
        self._ends = np.arange(latest, earliest, max(step, 1))
        # of innovations and of a pulse of 1, all else fitted: their products, and its squares
        self._products, self._squares = np.zeros(self._ends.size), np.zeros(self._ends.size)
        self.pulse = None
        """What is taken out, None: nothing."""
        self.covariance = np.zeros((width, width))
        """Of theta (m, m), by what is not known of the pulse that is taken out."""

    def undone(self, window: Window) -> Window:
        """A window without the pulse."""
        return window if self.pulse is None else self.pulse.taken_out(window)

    def take_in(
        self,
        window: Window,
        edge: Edge,
        innovations: Innovations,
        slopes: NDArray[np.float64],
        prior: NDArray[np.float64],
    ) -> None:
        """An event as it was recorded, at whose openings there is such an edge.

        innovations: (n,) of a window, in standard deviations, 0 where they do not count; slopes: (n, m) of the same
        by theta; prior: (m,) standard deviations.
        """
        self._products *= REMEMBERED
        self._squares *= REMEMBERED
        information = slopes.T @ slopes + np.diag(prior**-2)
        whole = innovations(window)
        left = np.clip(whole, -CLIP, CLIP)
        pull = np.linalg.solve(information, slopes.T @ left)
        taken = np.empty((self._ends.size, prior.size))  # for a pulse of 1
        for i, end in enumerate(self._ends):
            without = innovations(CoilPulse(edge.height, edge.before, int(end)).taken_out(window))
            shape = (whole - without) / edge.height
            by_theta = slopes.T @ shape
            taken[i] = np.linalg.solve(information, by_theta)
            self._products[i] += float(shape @ left - by_theta @ pull)
            self._squares[i] += float(shape @ shape - by_theta @ taken[i])
        explained = 0.5 * self._products**2 / self._squares
        best = int(np.argmax(explained))
        others = np.abs(np.arange(self._ends.size) - best) > 1
        is_within = 0 < best < self._ends.size - 1
        is_clear = bool(explained[best] - explained[others].max() > CLEAR)
        if self.pulse is None and not (is_within and is_clear):
            return
        height = float(self._products[best] / self._squares[best])
        if self.pulse is None:
            self._products *= BEFORE_KNOWN
            self._squares *= BEFORE_KNOWN
        self.pulse = CoilPulse(height, edge.before, int(self._ends[best]))
        variance = 1.0 / self._squares[best] + (SHAPE * height) ** 2
        self.covariance = variance * np.outer(taken[best], taken[best])

    def forget(self) -> None:
        """There is no edge."""
        self._products[:], self._squares[:] = 0.0, 0.0
        self.pulse, self.covariance = None, np.zeros_like(self.covariance)


class Energizing(Tracker):
    """Follows it event after event, and takes it out of events once it is known."""

    _edges: EdgeSearch
    _current: CoilCurrent

    def __init__(self, interval: float, prior: NDArray[np.float64]) -> None:
        """interval: of samples [s]; prior: standard deviations (m,) of theta before any event."""
        self._prior = prior
        self._edges = EdgeSearch(interval)
        self._current = CoilCurrent(interval, prior.size)

    @property
    def is_known(self) -> bool:
        """Whether it is taken out."""
        return self._current.pulse is not None

    @property
    def covariance(self) -> NDArray[np.float64]:
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
