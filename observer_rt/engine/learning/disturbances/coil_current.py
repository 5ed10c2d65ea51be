"""Disturbance of the line pressure by the coil's current, taken out once it is known well enough.

Its beginning is a step at the same time before every opening. The needle is shut then and nothing moves, so the model
has nothing to say to it, however small it is; over many events it stands out of the noise. Its end lies in the
injection: it is sought where the events, all else fitted, are explained best. Until that is clear nothing is taken
out. Left in, it would be taken for wear.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.fitting import EventFit
from observer_rt.model.effective import Coefficients
from observer_rt.model.valve import AT

LONGEST_DELAY = 0.45e-3  # s, from the start of energizing to the opening
SHORTEST_DELAY = 0.12e-3
# s that do not count: a lift that is recorded late lets the line pressure fall in them.
BEFORE_OPENING = 0.06e-3
EDGE_CLIP = 3.0  # standard deviations for which an innovation counts at most: one event alone is an outlier
SEEN_FOR = 0.25e-3  # s, until x~ has taken a step for its own
FEWEST = 2  # samples of it: at a low sample rate no edge is seen
STANDS_OUT = 4.5  # standard deviations
OF_ONE_EVENT = 4.0  # of these at most, so that it must recur
COMMON = 0.6  # of it, up to which steps may stand out that are no edge: then the standstill is not understood at all
EARLIEST_END, LATEST_END = 0.65e-3, 0.05e-3  # s before the closing
END_STEP = 0.05e-3  # s from one end that is tried to the next
REMEMBERED = 0.95  # weight of the events before an event
CLEAR = 9.0  # chi2 / 2 by which an end must be better than those that are not beside it: more than four sigma
# Weight of events that were fitted with the pulse: it was taken for something else in part.
BEFORE_KNOWN = 0.02
SHAPE = 0.05  # of its height, by which it is no rectangle
CLIP = 4.0  # standard deviations for which an innovation counts at most
FLOW_BLURS = 0.04e-3  # s before a pilot valve opens that its flow begins
FEWEST_BEFORE_FLOW = 8  # samples by which a step is told from the flow of a pilot valve

Innovations = Callable[[Window], NDArray[np.float64]]


@dataclass(frozen=True)
class Edge:
    """A step of a height [p_0] so many samples before the openings."""

    height: float
    before: int


class EdgePlaces(NamedTuple):
    """Range of samples before an opening in which an edge is sought, and for how many samples it is seen.

    margin: samples before the opening that do not count; fewest: samples of an edge that must count.
    """

    shortest: int
    longest: int
    seen_for: int
    margin: int
    fewest: int = 1

    def before_flow(self, samples: int) -> "EdgePlaces":
        """Places of a servo injector, whose flow begins so many samples before the opening: nothing from there on."""
        return self._replace(margin=max(self.margin, samples), fewest=FEWEST_BEFORE_FLOW)

    @property
    def all(self) -> int:
        """Number of places that are compared."""
        return self.longest + self.seen_for


def edge_places(interval: float) -> EdgePlaces:
    """Places at an interval of samples [s]."""
    durations = (SHORTEST_DELAY, LONGEST_DELAY, SEEN_FOR, BEFORE_OPENING)
    shortest, longest, seen_for, margin = (round(duration / interval) for duration in durations)
    return EdgePlaces(shortest, longest, max(seen_for, FEWEST), margin)


@dataclass(frozen=True, eq=False)
class EdgeSearch:
    """Sums over events by which a step at one time before the openings shows; empty before any.

    unclipped: (2, places), both sums without limits, which tell how high the step is, and where.
    """

    products: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    squares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    unclipped: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 0)))

    def after(
        self,
        window: Window,
        innovations: NDArray[np.float64],
        response: NDArray[np.float64],
        sigma: float,
        places: EdgePlaces,
    ) -> "EdgeSearch":
        """Adds an event's innovations (n,).

        response: (n,) of the innovations to a step of y at the sample `longest` before the opening.
        """
        before, n = self, places.all
        if self.products.size != n:
            before = EdgeSearch(np.zeros(n), np.zeros(n), np.zeros((2, n)))
        opening = window.opening
        clipped = np.clip(innovations[:opening] / sigma, -EDGE_CLIP, EDGE_CLIP)
        shape = response[opening - places.longest : opening - places.longest + places.seen_for]
        products, squares = np.zeros((2, places.all))
        _compare(clipped, shape, places, products, squares)
        most = OF_ONE_EVENT * np.sqrt(squares)
        return EdgeSearch(
            REMEMBERED * before.products + np.clip(products, -most, most),
            REMEMBERED * before.squares + squares,
            REMEMBERED * before.unclipped + (products / sigma, squares / sigma**2),
        )

    def edge(self, places: EdgePlaces) -> Edge | None:
        """The step that stands out of the noise; None without one."""
        power = np.maximum(self.squares, np.finfo(np.float64).tiny)
        scores = np.abs(self.products) / np.sqrt(power)
        score, elsewhere = scores[: places.longest + 1].max(), scores[places.longest + 1 :].max()
        if not (score > STANDS_OUT and elsewhere < COMMON * score):
            return None
        products, squares = self.unclipped[:, : places.longest + 1]
        before = int(np.argmax(products**2 / np.maximum(squares, np.finfo(np.float64).tiny)))
        return Edge(float(products[before] / squares[before]), before)


def _compare(
    innovations: NDArray[np.float64],
    shape: NDArray[np.float64],
    places: EdgePlaces,
    products: NDArray[np.float64],
    squares: NDArray[np.float64],
) -> None:
    """Products of innovations with a shape that begins so many samples before their end, and its squares.

    For every place of `products` and `squares`.
    """
    n = innovations.size
    counts = np.concatenate((innovations[: n - places.margin], np.zeros(shape.size)))
    least = places.margin + min(places.fewest, shape.size)
    at = np.arange(max(places.shortest, least), min(products.size, n))
    products[at] += np.correlate(counts, shape, "valid")[n - at]
    squares[at] += np.cumsum(shape**2)[np.minimum(at - places.margin, shape.size) - 1]


def with_step(window: Window, first: int, height: float) -> Window:
    """A window with a step of the line pressure [p_0] from sample `first` on."""
    output = window.output.copy()
    output[first:] += height
    return window._replace(output=output)


@dataclass(frozen=True)
class CoilPulse:
    """Pulse of a height [p_0], from so many samples before every opening until so many before its closing."""

    height: float
    before: int
    until: int

    def taken_out(self, window: Window) -> Window:
        """Window without the pulse."""
        output = window.output.copy()
        is_open = np.concatenate(([False], window.inputs[:, 1] > 0.0, [False]))
        edges = np.flatnonzero(np.diff(is_open))
        for opening, shut in zip(edges[::2], edges[1::2], strict=True):
            output[max(opening - self.before, 0) : max(shut - self.until, opening)] -= self.height
        return window._replace(output=output)


def pulse_ends(interval: float) -> NDArray[np.int64]:
    """Samples before a closing at which the end of the pulse is sought; interval: of samples [s]."""
    earliest, latest, step = (round(t / interval) for t in (EARLIEST_END, LATEST_END, END_STEP))
    return np.arange(latest, earliest, max(step, 1))


@dataclass(frozen=True, eq=False)
class CoilCurrent:
    """The pulse that is taken out, None: nothing, and the sums over events by which its end is sought.

    products: of innovations and of a pulse of 1, all else fitted, by end, squares: those of the pulse, both empty
    before any event; covariance: of theta (m, m), by the uncertainty of the pulse, None: 0.
    """

    products: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    squares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    pulse: CoilPulse | None = None
    covariance: NDArray[np.float64] | None = None

    @property
    def unsure(self) -> NDArray[np.float64] | float:
        """Covariance of theta (m, m) by the uncertainty of the pulse, or 0."""
        return 0.0 if self.covariance is None else self.covariance

    def undone(self, window: Window) -> Window:
        """A window without the pulse."""
        return window if self.pulse is None else self.pulse.taken_out(window)

    def after(
        self,
        window: Window,
        edge: Edge,
        innovations: Innovations,
        slopes: NDArray[np.float64],
        prior: NDArray[np.float64],
        ends: NDArray[np.int64],
    ) -> "CoilCurrent":
        """Adds an event as it was recorded, at whose openings there is such an edge.

        innovations: (n,) of a window, in standard deviations, 0 where they do not count; slopes: (n, m) of the same
        by theta; prior: (m,) standard deviations.
        """
        is_begun = self.products.size == ends.size
        products = REMEMBERED * self.products if is_begun else np.zeros(ends.size)
        squares = REMEMBERED * self.squares if is_begun else np.zeros(ends.size)
        information = slopes.T @ slopes + np.diag(prior**-2)
        innovations_of_event = innovations(window)
        left = np.clip(innovations_of_event, -CLIP, CLIP)
        pull = np.linalg.solve(information, slopes.T @ left)
        taken = np.empty((ends.size, prior.size))  # for a pulse of 1
        for i, end in enumerate(ends):
            without = innovations(CoilPulse(edge.height, edge.before, int(end)).taken_out(window))
            shape = (innovations_of_event - without) / edge.height
            by_theta = slopes.T @ shape
            taken[i] = np.linalg.solve(information, by_theta)
            products[i] += float(shape @ left - by_theta @ pull)
            squares[i] += float(shape @ shape - by_theta @ taken[i])
        explained = 0.5 * products**2 / squares
        best = int(np.argmax(explained))
        others = np.abs(np.arange(ends.size) - best) > 1
        is_within = 0 < best < ends.size - 1
        is_clear = bool(explained[best] - explained[others].max() > CLEAR)
        if self.pulse is None and not (is_within and is_clear):
            return replace(self, products=products, squares=squares)
        height = float(products[best] / squares[best])
        if self.pulse is None:
            products *= BEFORE_KNOWN
            squares *= BEFORE_KNOWN
        pulse = CoilPulse(height, edge.before, int(ends[best]))
        variance = 1.0 / squares[best] + (SHAPE * height) ** 2
        return CoilCurrent(products, squares, pulse, variance * np.outer(taken[best], taken[best]))


@dataclass(frozen=True, eq=False)
class Energizing:
    """Findings of events about the coil's pulse, which is taken out of them once it is known."""

    edges: EdgeSearch = field(default_factory=EdgeSearch)
    current: CoilCurrent = field(default_factory=CoilCurrent)

    @property
    def is_known(self) -> bool:
        """Whether the pulse is taken out."""
        return self.current.pulse is not None

    def after(
        self,
        window: Window,
        fit: EventFit,
        sigma: float,
        cost_of: Callable[[Window], EventCost],
        prior: NDArray[np.float64],
        interval: float,
        model: Coefficients,
    ) -> tuple["Energizing", bool]:
        """Adds a fitted event as it was recorded; returns whether something was in it that was not taken out, too.

        sigma: of the innovations [p_0]; cost_of: a window's cost; prior: standard deviations (m,) of theta before
        any event; interval: of samples [s]; model: as fitted.
        """
        places = edge_places(interval)
        if model.line.servo > 0.0:
            rail = (
                float(window.inputs[window.opening, 0]) * model.pressure_scale + model.chamber_pressure
            ) / AT
            ahead = model.valve.start * rail**-model.valve.exponent + FLOW_BLURS
            if model.valve.commanded:
                begun = window.commands[window.commands[:, 0] <= window.opening, 0]
                ahead += interval * (window.opening - begun.max(initial=-np.inf))
            places = places.before_flow(round(min(ahead / interval, places.longest)))
        first = window.opening - places.longest
        if first <= 0:
            return self, False
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
        edges = self.edges.after(shut, sigma * before, response, sigma, places)
        edge = edges.edge(places)
        if edge is None:
            return Energizing(edges), self.is_known
        slopes, ends = fit.slopes / sigma, pulse_ends(interval)
        return Energizing(
            edges, self.current.after(window, edge, left, slopes, prior, ends)
        ), not self.is_known
