"""Disturbance of the line pressure by the coil's current: a step before openings, taken out once known.

The current adds a pulse to the measured line pressure, which would be taken for wear. It begins with a step at the
same time before every opening: the needle is shut and nothing moves, so that no parameter can imitate it; only where
a pilot valve opens must the whole event tell the step from its gradual flow. One event hardly shows the step, many
do, and so does what a model lacks: two events running must be explained better with the pulse than by theta and such
a valve. Its end, during the injection, is that of a grid with which events are best explained, everything else
fitted. It is taken out once one end is more likely than all others together; from then on the covariance of theta
contains the change by another end.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.engine.estimation.parameters import PARAMETERS, Parameter
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.run import EventCost, EventRun
from observer_rt.foundation.records import NOT_KEPT
from observer_rt.foundation.units import Ints
from observer_rt.model.effective import LAG_UNIT

LONGEST_DELAY = 0.45e-3  # s, from the start of energizing to the opening
SHORTEST_DELAY = 0.12e-3
BEFORE_OPENING = 0.06e-3  # s that do not count: a lift that is recorded late lets the line pressure fall in them.
EDGE_CLIP = 3.0  # standard deviations for which an innovation counts at most: one event alone is an outlier
SEEN_FOR = 0.25e-3  # s, until x~ has taken a step for its own
FEWEST = 2  # samples of SEEN_FOR at a low sample rate
STANDS_OUT = 4.5  # standard deviations, beyond which a step over all events is an edge
OF_ONE_EVENT = 4.0  # standard deviations that one event adds at most, so that an edge must recur
STANDS_OUT_ALONE = 3.0  # standard deviations in one event, beyond which it may be the first witness
COMMON = 0.6  # share of the edge's score that no step elsewhere may reach, else the model does not explain the rest
REMEMBERED = 0.95  # weight of the events before an event
CLIP = 4.0  # standard deviations for which an innovation counts at most, all else fitted
EARLIEST_END, LATEST_END = 0.65e-3, 0.05e-3  # s before the closing
END_STEP = 0.05e-3  # s from one end that is tried to the next
CLEAR = 0.5  # probability of one end of the grid, from which on the pulse is taken out
# Weight of the events before: they were fitted with the pulse in them, which was taken for something else in part.
BEFORE_KNOWN = 0.02
SHAPE = 0.05  # of its height, by which a pulse may differ from a rectangle
BEATS, WITNESSES = 4.0, 2  # nats by which a pulse explains an event better than none, in so many events running
TRIED = 1e-3  # p_0, height of the pulse by which the response to one is found
OTHER_STARTS = (-0.2e-3, -0.1e-3, 0.1e-3, 0.2e-3)  # s by which the flow of a pilot valve may begin before the model's
USUAL_END = 0.25e-3  # s before the closing; assumed while the beginning is sought beside a pilot valve's flow

Innovations = Callable[[Window], Vector]


class EdgePlaces(NamedTuple):
    """Places of an edge, in samples before an opening."""

    shortest: int  # from an edge to the opening
    longest: int
    seen_for: int  # until x~ has taken a step for its own
    margin: int  # just before the opening, which do not count
    all: int  # how many are compared, those too early for an edge among them


def edge_places(interval: float) -> EdgePlaces:
    """Places of an edge at an interval of samples [s]."""
    durations = (SHORTEST_DELAY, LONGEST_DELAY, SEEN_FOR, BEFORE_OPENING)
    shortest, longest, seen_for, margin = (round(duration / interval) for duration in durations)
    seen_for = max(seen_for, FEWEST)
    return EdgePlaces(shortest, longest, seen_for, margin, longest + seen_for)


@dataclass(frozen=True, eq=False)
class EdgeSearch:
    """Sums over events by which a step at one time before the openings shows; empty before any."""

    products: Vector = field(default_factory=lambda: np.zeros(0))  # (places,) of innovations and response, limited
    squares: Vector = field(default_factory=lambda: np.zeros(0))  # (places,) of the response
    unclipped: Matrix = field(default_factory=lambda: np.zeros((2, 0)))  # (2, places) both, not limited

    def after(self, sums: Matrix) -> "EdgeSearch":
        """The next value, after an event's products and squares (2, places)."""
        before, (products, squares) = self, sums
        if self.products.size != products.size:
            before = EdgeSearch(np.zeros_like(products), np.zeros_like(squares), np.zeros_like(sums))
        most = OF_ONE_EVENT * np.sqrt(squares)
        return EdgeSearch(
            REMEMBERED * before.products + np.clip(products, -most, most),
            REMEMBERED * before.squares + squares,
            REMEMBERED * before.unclipped + sums,
        )

    def edge(self, places: EdgePlaces, least: float = STANDS_OUT) -> int | None:
        """Samples from the step that stands out of the noise by `least` to the openings; None without one."""
        power = np.maximum(self.squares, np.finfo(np.float64).tiny)
        scores = np.abs(self.products) / np.sqrt(power)
        score, elsewhere = scores[: places.longest + 1].max(), scores[places.longest + 1 :].max()
        products, squares = self.unclipped[:, : places.longest + 1]
        before = int(np.argmax(products**2 / np.maximum(squares, np.finfo(np.float64).tiny)))
        return before if score > least and elsewhere < COMMON * score else None


def sums_at_rest(innovations: Vector, response: Vector, places: EdgePlaces) -> Matrix:
    """Products and squares (2, places) of a step before the opening, where only noise may hide it.

    innovations (n,): until then, in standard deviations; response (n,): to a step of y by one, `longest` before it.
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
    opening: int, innovations: Vector, response: Vector, theta: "ThetaColumns", places: EdgePlaces
) -> Matrix:
    """Products and squares (2, places) of a pulse beside the flow of a pilot valve, with theta fitted.

    Both begin before the opening (its sample), so that only the whole event tells them apart. innovations (n,): in
    standard deviations; response (n,): to a pulse of one from the sample `longest` before the opening on.
    """
    first = opening - places.longest
    at = np.arange(places.shortest, places.longest + 1)
    pulses = np.repeat(response[:, np.newaxis], at.size, axis=1)
    # Until the opening the needle is shut, and answers alike whenever the pulse begins.
    for i, before in enumerate(at):
        pulses[: opening - before, i] = 0.0
        pulses[opening - before : opening, i] = response[first : first + before]
    alone = pulses - theta.slopes @ theta.pull(pulses)  # less the part that theta explains
    sums = np.zeros((2, places.all))
    sums[0, at] = alone.T @ np.clip(innovations, -CLIP, CLIP)
    sums[1, at] = np.einsum("ij,ij->j", pulses, alone)
    return sums


class ThetaColumns(NamedTuple):
    """Slopes (n, m) of an event's innovations by theta, and the information (m, m) of event and prior."""

    slopes: Matrix
    information: Matrix

    @classmethod
    def of(cls, slopes: Matrix, prior: Vector) -> "ThetaColumns":
        """Columns of an event by slopes (n, m); prior: (m,) standard deviations of theta."""
        return cls(slopes, slopes.T @ slopes + np.diag(prior**-2))

    def pull(self, columns: Matrix) -> Matrix:
        """Theta (m, k) or (m,) that explains columns (n, k) or (n,) best."""
        return np.asarray(np.linalg.solve(self.information, self.slopes.T @ columns), np.float64)


@dataclass(frozen=True)
class CoilPulse:
    """Pulse of a height [p_0], from `before` samples before an opening until `until` samples before its closing."""

    height: float
    before: int
    until: int

    def taken_out(self, window: Window) -> Window:
        output = window.output.copy()
        is_open = np.concatenate(([False], window.inputs[:, 1] > 0.0, [False]))
        edges = np.flatnonzero(np.diff(is_open))
        for opening, shut in zip(edges[::2], edges[1::2], strict=True):
            output[max(opening - self.before, 0) : max(shut - self.until, opening)] -= self.height
        return window._replace(output=output)


def pulse_ends(interval: float) -> Ints:
    """Grid of ends of the pulse, in samples before the closing; interval: of samples [s]."""
    earliest, latest, step = (round(t / interval) for t in (EARLIEST_END, LATEST_END, END_STEP))
    return np.arange(latest, earliest, max(step, 1))


@dataclass(frozen=True, eq=False)
class CoilCurrent:
    """The pulse that is taken out, and the sums over events by which its end is found, empty before the first.

    A pulse of height 1 changes the innovations by its response; only the part that theta cannot imitate counts.
    """

    products: Vector = field(default_factory=lambda: np.zeros(0))  # (ends,) of response and innovations
    squares: Vector = field(default_factory=lambda: np.zeros(0))  # (ends,) of the response
    pulse: CoilPulse | None = None  # None: nothing is taken out yet
    covariance: Matrix | None = None  # of theta (m, m), by the uncertainty of the pulse; None: 0
    witnesses: int = field(default=0, metadata=NOT_KEPT)  # events running that the pulse explains better than none

    @property
    def unsure(self) -> Matrix | float:
        """Covariance of theta (m, m) by the uncertainty of the pulse; 0 while nothing is taken out."""
        return 0.0 if self.covariance is None else self.covariance

    def undone(self, window: Window) -> Window:
        """Window without the pulse, if that is known."""
        return window if self.pulse is None else self.pulse.taken_out(window)

    def after(
        self, window: Window, before: int, innovations: Innovations, theta: ThetaColumns, ends: Ints
    ) -> "CoilCurrent":
        """The next value after an event as recorded, its edge `before` samples early; ends: grid to compare."""
        innovations_of_event = innovations(window)
        clipped = np.clip(innovations_of_event, -CLIP, CLIP)
        without = [innovations(CoilPulse(TRIED, before, int(end)).taken_out(window)) for end in ends]
        shapes = (innovations_of_event - np.array(without)).T / TRIED  # (n, ends), of a pulse of 1
        pull = theta.pull(shapes).T  # (ends, m), of theta
        alone = shapes - theta.slopes @ pull.T
        own_products, own_squares = alone.T @ clipped, np.einsum("ij,ij->j", alone, shapes)
        is_begun = self.products.size == ends.size
        products = own_products + (REMEMBERED * self.products if is_begun else 0.0)
        squares = own_squares + (REMEMBERED * self.squares if is_begun else 0.0)
        heights = products / squares
        explains = float(np.max(heights * (own_products - 0.5 * heights * own_squares)))
        witnesses = self.witnesses + 1 if explains > BEATS else self.witnesses * (self.witnesses >= WITNESSES)
        explained = 0.5 * heights * products
        weights = np.exp(explained - explained.max())
        best = int(np.argmax(weights))
        is_clear = best not in (0, ends.size - 1) and weights[best] >= CLEAR * weights.sum()
        if self.pulse is None and (witnesses < WITNESSES or not is_clear):
            return replace(self, products=products, squares=squares, witnesses=witnesses)
        products, squares = np.array([products, squares]) * (BEFORE_KNOWN if self.pulse is None else 1.0)
        pulse = CoilPulse(float(heights[best]), before, int(ends[best]))
        # difference of theta (ends, m) if the pulse has another end; its covariance is also by other heights
        pull = pull[:, :PARAMETERS]
        difference = heights[:, np.newaxis] * pull - heights[best] * pull[best]
        variances = 1.0 / squares + (SHAPE * heights) ** 2
        shares = (weights / weights.sum())[:, np.newaxis]
        covariance = difference.T @ (shares * difference) + (pull.T * variances * shares[:, 0]) @ pull
        return CoilCurrent(products, squares, pulse, covariance, witnesses)


@dataclass(frozen=True, eq=False)
class CoilDisturbance:
    """Evidence of the coil's pulse in the events so far, and the pulse, which is taken out once it is known."""

    edges: EdgeSearch = field(default_factory=EdgeSearch)
    current: CoilCurrent = field(default_factory=CoilCurrent)

    @property
    def is_known(self) -> bool:
        """Whether the pulse is known, and so taken out."""
        return self.current.pulse is not None

    def after(
        self, window: Window, run: EventRun, sigma: float, cost: EventCost, wide: Vector, interval: float, flows: bool
    ) -> tuple["CoilDisturbance", bool]:
        """The next value, after an event as recorded; True if that has a pulse that was not taken out.

        run, cost: of the event as fitted; sigma: of innovations, as events scatter [p_0]; wide: standard deviations
        (m,) of theta before any; interval [s] of samples; flows: the flow of a pilot valve is in the event.
        """
        places, theta = edge_places(interval), run.theta
        first = window.opening - places.longest
        if first <= 0:
            return self, False

        def standardised(window: Window, theta: Vector = theta) -> Vector:
            """Innovations in standard deviations, by default at the fit."""
            counts = replace(cost, window=window).innovations(theta) / sigma
            counts[: cost.burn_in] = 0.0
            return counts

        def columns() -> ThetaColumns:
            """Theta, and flows of a pilot valve of the usual size at other times."""
            as_fitted, slopes = standardised(window), [run.slopes / sigma]
            for earlier in OTHER_STARTS:
                other = theta.copy()
                other[Parameter.CONTROL_FLOW] += wide[Parameter.CONTROL_FLOW]
                other[Parameter.CONTROL_START] += earlier / LAG_UNIT
                slopes.append((standardised(window, other) - as_fitted)[:, np.newaxis])
            return ThetaColumns.of(np.hstack(slopes), np.append(wide, np.ones(len(OTHER_STARTS))))

        theta_columns, event = (columns(), window) if flows else (None, window.until(window.opening))
        innovations = standardised(event)
        if theta_columns is not None:
            pulse = CoilPulse(-sigma, places.longest, round(USUAL_END / interval))
            response = standardised(pulse.taken_out(event)) - innovations
            sums = sums_beside_flow(window.opening, innovations, response, theta_columns, places)
        else:
            step = sigma * (np.arange(event.output.size) >= first)
            response = standardised(event._replace(output=event.output + step)) - innovations
            sums = sums_at_rest(innovations, response, places)
        edges = self.edges.after(sums)
        recurs = edges.edge(places)
        before = recurs or EdgeSearch(sums[0], sums[1], sums).edge(places, STANDS_OUT_ALONE)
        if before is None or (self.is_known and not recurs):
            return CoilDisturbance(edges), self.is_known
        current = self.current if recurs else CoilCurrent()
        current = current.after(window, before, standardised, theta_columns or columns(), pulse_ends(interval))
        return CoilDisturbance(edges, current), not self.is_known and current.witnesses >= WITNESSES
