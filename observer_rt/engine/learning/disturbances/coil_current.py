"""Disturbance of the line pressure by the coil's current: sought as a step before openings, taken out once known.

The current adds a pulse to the measured line pressure, which would be taken for wear. It begins with a step at the
same time before every opening: the needle is shut then and nothing moves, so no parameter of the model can imitate
the step, but where a pilot valve has opened: only the whole event tells the step from its flow. One event hardly
shows it; over many events it stands out of the noise, however small it is. The pulse ends during the injection: each
end on a grid is compared by how well the events are explained with it, everything else fitted. The pulse is taken out
once one end is more likely than all others together; from then on the covariance of theta contains the change that
another end would make.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.fitting import EventFit

LONGEST_DELAY = 0.45e-3  # s, from the start of energizing to the opening
SHORTEST_DELAY = 0.12e-3
# s that do not count: a lift that is recorded late lets the line pressure fall in them.
BEFORE_OPENING = 0.06e-3
EDGE_CLIP = 3.0  # standard deviations for which an innovation counts at most: one event alone is an outlier
SEEN_FOR = 0.25e-3  # s, until x~ has taken a step for its own
FEWEST = 2  # samples of it: at a low sample rate no edge is seen
STANDS_OUT = 4.5  # standard deviations
OF_ONE_EVENT = 4.0  # of these at most, so that it must recur
STANDS_OUT_ALONE = 6.0  # of these, in one event: its mass is not trusted, for a late lift looks alike
COMMON = 0.6  # of it, up to which steps may stand out that are no edge: then the standstill is not understood at all
REMEMBERED = 0.95  # weight of the events before an event
CLIP = 4.0  # standard deviations for which an innovation counts at most, all else fitted
EARLIEST_END, LATEST_END = 0.65e-3, 0.05e-3  # s before the closing
END_STEP = 0.05e-3  # s from one end that is tried to the next
CLEAR = 0.5  # probability of an end, among all on the grid, from which on the pulse is taken out
# Weight of the events before: they were fitted with the pulse in them, which was taken for something else in part.
BEFORE_KNOWN = 0.02
SHAPE = 0.05  # of its height, by which a pulse may differ from a rectangle
USUAL_END = 0.25e-3  # s before the closing; assumed while the beginning is sought beside a pilot valve's flow

Innovations = Callable[[Window], NDArray[np.float64]]


@dataclass(frozen=True)
class Edge:
    """A step of a height [p_0] so many samples before the openings."""

    height: float
    before: int


class EdgePlaces(NamedTuple):
    """Samples before an opening between which an edge is sought, is seen for, and that do not count at its end."""

    shortest: int
    longest: int
    seen_for: int
    margin: int

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
    """Sums over events by which a step at one time before the openings shows; empty before any."""

    products: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    squares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    unclipped: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 0)))  # both without limits

    def after(self, sums: NDArray[np.float64], sigma: float) -> "EdgeSearch":
        """Adds an event's sums (2, places), products and squares, of innovations of sigma [p_0]."""
        before, (products, squares) = self, sums
        if self.products.size != products.size:
            before = EdgeSearch(np.zeros_like(products), np.zeros_like(squares), np.zeros_like(sums))
        most = OF_ONE_EVENT * np.sqrt(squares)
        return EdgeSearch(
            REMEMBERED * before.products + np.clip(products, -most, most),
            REMEMBERED * before.squares + squares,
            REMEMBERED * before.unclipped + (products / sigma, squares / sigma**2),
        )

    def edge(self, places: EdgePlaces, least: float = STANDS_OUT) -> Edge | None:
        """The step that stands out of the noise by so many standard deviations; None without one."""
        power = np.maximum(self.squares, np.finfo(np.float64).tiny)
        scores = np.abs(self.products) / np.sqrt(power)
        score, elsewhere = scores[: places.longest + 1].max(), scores[places.longest + 1 :].max()
        if not (score > least and elsewhere < COMMON * score):
            return None
        products, squares = self.unclipped[:, : places.longest + 1]
        before = int(np.argmax(products**2 / np.maximum(squares, np.finfo(np.float64).tiny)))
        return Edge(float(products[before] / squares[before]), before)


def sums_at_rest(
    innovations: NDArray[np.float64], response: NDArray[np.float64], places: EdgePlaces
) -> NDArray[np.float64]:
    """Products and squares (2, places) of a step before the opening, which only noise may hide.

    innovations: (n,) until the opening, in standard deviations; response: (n,) of them to a step of y by one, at the
    sample `longest` before the opening.
    """
    n = innovations.size
    shape = response[n - places.longest : n - places.longest + places.seen_for]
    counts = np.clip(innovations[: n - places.margin], -EDGE_CLIP, EDGE_CLIP)
    counts = np.concatenate((counts, np.zeros(shape.size)))
    at = np.arange(max(places.shortest, places.margin + 1), min(places.all, n))
    sums = np.zeros((2, places.all))
    sums[0, at] = np.correlate(counts, shape, "valid")[n - at]
    sums[1, at] = np.cumsum(shape**2)[np.minimum(at - places.margin, shape.size) - 1]
    return sums


def sums_beside_flow(
    opening: int,
    innovations: NDArray[np.float64],
    response: NDArray[np.float64],
    other: "OtherColumns",
    places: EdgePlaces,
) -> NDArray[np.float64]:
    """Products and squares (2, places) of a pulse beside the flow of a pilot valve, `other` columns fitted.

    Both begin before the opening, so that the whole event must tell them apart. innovations: (n,) of an event that
    opens at a sample, in standard deviations; response: (n,) of them to a pulse of one, from the sample `longest`
    before the opening on.
    """
    first = opening - places.longest
    at = np.arange(places.shortest, places.longest + 1)
    pulses = np.repeat(response[:, np.newaxis], at.size, axis=1)
    # Until the opening the needle is shut, and answers alike whenever the pulse begins.
    for i, before in enumerate(at):
        pulses[: opening - before, i] = 0.0
        pulses[opening - before : opening, i] = response[first : first + before]
    alone = other.taken_from(pulses)
    sums = np.zeros((2, places.all))
    sums[0, at] = alone.T @ np.clip(innovations, -CLIP, CLIP)
    sums[1, at] = np.einsum("ij,ij->j", pulses, alone)
    return sums


class OtherColumns(NamedTuple):
    """Slopes (n, m) of an event's innovations by theta, and their information (m, m) with the prior."""

    slopes: NDArray[np.float64]
    information: NDArray[np.float64]

    @classmethod
    def of(cls, slopes: NDArray[np.float64], prior: NDArray[np.float64]) -> "OtherColumns":
        """Columns of an event; prior: (m,) standard deviations of theta."""
        return cls(slopes, slopes.T @ slopes + np.diag(prior**-2))

    def taken_from(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """What theta cannot explain of columns (n, k) or (n,)."""
        return np.asarray(columns - self.slopes @ self.pull(columns))

    def pull(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Theta (m, k) or (m,) that explains columns (n, k) or (n,) best."""
        return np.asarray(np.linalg.solve(self.information, self.slopes.T @ columns), np.float64)


def with_step(window: Window, first: int, height: float) -> Window:
    """A window with a step of the line pressure [p_0] from sample `first` on."""
    output = window.output.copy()
    output[first:] += height
    return window._replace(output=output)


@dataclass(frozen=True)
class CoilPulse:
    """Pulse of a height [p_0], from `before` samples before an opening until `until` samples before its closing."""

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
    """Grid of ends of the pulse, in samples before the closing; interval: of samples [s]."""
    earliest, latest, step = (round(t / interval) for t in (EARLIEST_END, LATEST_END, END_STEP))
    return np.arange(latest, earliest, max(step, 1))


@dataclass(frozen=True, eq=False)
class CoilCurrent:
    """The pulse that is taken out, and the sums over events by which its end is found.

    A pulse of height 1 changes the innovations by its response; of that the part counts which theta cannot imitate.
    """

    # of the response and the innovations, (ends,), and of the response with itself; empty before the first event
    products: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    squares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    pulse: CoilPulse | None = None  # None: nothing is taken out yet
    covariance: NDArray[np.float64] | None = None  # of theta (m, m), by the uncertainty of the pulse; None: 0

    @property
    def unsure(self) -> NDArray[np.float64] | float:
        """Covariance of theta (m, m) by the uncertainty of the pulse; 0 while nothing is taken out."""
        return 0.0 if self.covariance is None else self.covariance

    def undone(self, window: Window) -> Window:
        """Window without the pulse, if that is known."""
        return window if self.pulse is None else self.pulse.taken_out(window)

    def after(
        self, window: Window, edge: Edge, innovations: Innovations, other: OtherColumns, ends: NDArray[np.int64]
    ) -> "CoilCurrent":
        """Value after an event as it was recorded, with such an edge before its openings.

        innovations: of a window (n,), in standard deviations, 0 where they do not count; other: columns of theta.
        """
        is_begun = self.products.size == ends.size
        products = REMEMBERED * self.products if is_begun else np.zeros(ends.size)
        squares = REMEMBERED * self.squares if is_begun else np.zeros(ends.size)
        innovations_of_event = innovations(window)
        clipped = np.clip(innovations_of_event, -CLIP, CLIP)
        pulses = (CoilPulse(edge.height, edge.before, int(end)) for end in ends)
        without = [innovations(pulse.taken_out(window)) for pulse in pulses]
        shapes = (innovations_of_event - np.array(without)).T / edge.height  # (n, ends), of a pulse of 1
        pull = other.pull(shapes).T  # (ends, m), of theta
        alone = shapes - other.slopes @ pull.T
        products += alone.T @ clipped
        squares += np.einsum("ij,ij->j", alone, shapes)
        heights = products / squares
        explained = 0.5 * heights * products
        weights = np.exp(explained - explained.max())
        best = int(np.argmax(weights))
        if self.pulse is None and (best in (0, ends.size - 1) or weights[best] < CLEAR * weights.sum()):
            return replace(self, products=products, squares=squares)
        if self.pulse is None:
            products *= BEFORE_KNOWN
            squares *= BEFORE_KNOWN
        pulse = CoilPulse(float(heights[best]), edge.before, int(ends[best]))
        # difference of theta (ends, m) if the pulse ends elsewhere; below also that by another height
        difference = heights[:, np.newaxis] * pull - heights[best] * pull[best]
        variances = 1.0 / squares + (SHAPE * heights) ** 2
        shares = (weights / weights.sum())[:, np.newaxis]
        covariance = difference.T @ (shares * difference) + (pull.T * variances * shares[:, 0]) @ pull
        return CoilCurrent(products, squares, pulse, covariance)


@dataclass(frozen=True, eq=False)
class Energizing:
    """What the events so far show of the coil's pulse, which is taken out of them once it is known."""

    edges: EdgeSearch = field(default_factory=EdgeSearch)
    current: CoilCurrent = field(default_factory=CoilCurrent)

    @property
    def is_known(self) -> bool:
        """Whether the pulse is known, and so taken out."""
        return self.current.pulse is not None

    def after(
        self,
        window: Window,
        fit: EventFit,
        sigma: float,
        cost_of: Callable[[Window], EventCost],
        prior: NDArray[np.float64],
        interval: float,
        flowing: bool,
    ) -> tuple["Energizing", bool]:
        """Value after a fitted event as it was recorded, and whether the event has a pulse that was not taken out.

        sigma: of the innovations [p_0]; cost_of: a window's cost; prior: standard deviations (m,) of theta before any
        event; interval: of samples [s]; flowing: whether the flow of a pilot valve is in the event.
        """
        places = edge_places(interval)
        first = window.opening - places.longest
        if first <= 0:
            return self, False
        theta = fit.linearisation.theta

        def standardised(window: Window) -> NDArray[np.float64]:
            """Innovations in standard deviations, at the fit."""
            cost = cost_of(window)
            cost.value(theta)
            counts = cost.innovations / sigma
            counts[: cost.burn_in] = 0.0
            return counts

        other = partial(OtherColumns.of, fit.slopes / sigma, prior)  # seldom needed
        event = window if flowing else window.until(window.opening)
        innovations = standardised(event)
        if flowing:
            until = int(np.flatnonzero(window.inputs[:, 1] > 0.0)[-1]) - round(USUAL_END / interval)
            response = standardised(with_step(with_step(event, first, sigma), until, -sigma)) - innovations
            sums = sums_beside_flow(window.opening, innovations, response, other(), places)
        else:
            response = standardised(with_step(event, first, sigma)) - innovations
            sums = sums_at_rest(innovations, response, places)
        edges = self.edges.after(sums, sigma)
        edge = edges.edge(places)
        if edge is None:
            stands_out = EdgeSearch(sums[0], sums[1], sums).edge(places, STANDS_OUT_ALONE) is not None
            return Energizing(edges), self.is_known or stands_out
        current = self.current.after(window, edge, standardised, other(), pulse_ends(interval))
        return Energizing(edges, current), not self.is_known
