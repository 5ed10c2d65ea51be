"""Disturbance of the line pressure by the coil's current, taken out once it is known well enough.

Its beginning is a step at the same time before every opening. The needle is shut then and nothing moves, so the model
has nothing to say to it, however small it is; over many events it stands out of the noise. Its end lies in the
injection: it is sought where the events, all else fitted, are explained best. Until that is likely nothing is taken
out; then, what another end would change widens theta. Left in, the pulse would be taken for wear.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.edges import (
    CLIP,
    REMEMBERED,
    Edge,
    EdgeSearch,
    OtherColumns,
    edge_places,
    sums_at_rest,
    sums_beside_flow,
)
from observer_rt.engine.learning.fitting import EventFit

EARLIEST_END, LATEST_END = 0.65e-3, 0.05e-3  # s before the closing
END_STEP = 0.05e-3  # s from one end that is tried to the next
CLEAR = 0.5  # probability of an end, among all that are tried, from which on the pulse is taken out
# Weight of events that were fitted with the pulse: it was taken for something else in part.
BEFORE_KNOWN = 0.02
SHAPE = 0.05  # of its height, by which it is no rectangle
# s before the closing, of a pulse whose beginning is sought beside the flow of a pilot valve
USUAL_END = 0.25e-3

Innovations = Callable[[Window], NDArray[np.float64]]


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
        other: OtherColumns,
        ends: NDArray[np.int64],
    ) -> "CoilCurrent":
        """Adds an event as it was recorded, at whose openings there is such an edge.

        innovations: (n,) of a window, in standard deviations, 0 where they do not count; other: columns by theta.
        """
        is_begun = self.products.size == ends.size
        products = REMEMBERED * self.products if is_begun else np.zeros(ends.size)
        squares = REMEMBERED * self.squares if is_begun else np.zeros(ends.size)
        innovations_of_event = innovations(window)
        left = np.clip(innovations_of_event, -CLIP, CLIP)
        pulses = (CoilPulse(edge.height, edge.before, int(end)) for end in ends)
        without = [innovations(pulse.taken_out(window)) for pulse in pulses]
        shapes = (innovations_of_event - np.array(without)).T / edge.height  # (n, ends), of a pulse of 1
        taken = other.pull(shapes).T
        alone = shapes - other.slopes @ taken.T
        products += alone.T @ left
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
        # by how much theta differs where the pulse ends elsewhere, or is of another height
        apart = heights[:, np.newaxis] * taken - heights[best] * taken[best]
        variances = 1.0 / squares + (SHAPE * heights) ** 2
        shares = (weights / weights.sum())[:, np.newaxis]
        covariance = apart.T @ (shares * apart) + taken.T @ (shares * variances[:, np.newaxis] * taken)
        return CoilCurrent(products, squares, pulse, covariance)


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
        flowing: bool,
    ) -> tuple["Energizing", bool]:
        """Adds a fitted event as it was recorded; returns whether something was in it that was not taken out, too.

        sigma: of the innovations [p_0]; cost_of: a window's cost; prior: standard deviations (m,) of theta before
        any event; interval: of samples [s]; flowing: whether a pilot valve's flow is in it.
        """
        places = edge_places(interval)
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

        other = partial(OtherColumns.of, fit.slopes / sigma, prior)  # seldom needed
        event = window if flowing else window.until(window.opening)
        innovations = left(event)
        if flowing:
            until = int(np.flatnonzero(window.inputs[:, 1] > 0.0)[-1]) - round(USUAL_END / interval)
            response = left(with_step(with_step(event, first, sigma), until, -sigma)) - innovations
            sums = sums_beside_flow(window.opening, innovations, response, other(), places)
        else:
            response = left(with_step(event, first, sigma)) - innovations
            sums = sums_at_rest(innovations, response, places)
        edges = self.edges.after(sums, sigma)
        edge = edges.edge(places)
        if edge is None:
            return Energizing(edges), self.is_known
        current = self.current.after(window, edge, left, other(), pulse_ends(interval))
        return Energizing(edges, current), not self.is_known
