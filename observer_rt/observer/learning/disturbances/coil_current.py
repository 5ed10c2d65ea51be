"""What the coil's current adds to the line pressure while it flows, once it is known well enough to be taken out.

Its beginning is a step before the openings (`edges`), which tells how much it is. Its end lies in the injection: it
is sought where the events, all else fitted, are explained best. Until that is clear nothing is taken out.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.observer.learning.disturbances.edges import Edge

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


class CoilCurrent:
    """Seeks the end of the pulse over the events, and takes the pulse out of those that follow."""

    def __init__(self, interval: float) -> None:
        """interval: of samples [s]."""
        earliest, latest, step = (round(t / interval) for t in (EARLIEST_END, LATEST_END, END_STEP))
        self._ends = np.arange(latest, earliest, max(step, 1))
        # of innovations and of a pulse of 1, all else fitted: their products, and its squares
        self._products, self._squares = np.zeros(self._ends.size), np.zeros(self._ends.size)
        self.pulse: CoilPulse | None = None
        """What is taken out, None: nothing."""
        self.covariance: NDArray[np.float64] | float = 0.0
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
        self.pulse, self.covariance = None, 0.0
