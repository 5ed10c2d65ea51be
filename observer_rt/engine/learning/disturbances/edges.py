"""A step of the line pressure at the same time before every opening, as energizing the coil makes it.

One event hardly shows it; over many it stands out of the noise. The needle is shut then and nothing moves, so the
model has nothing to say to it, but where a pilot valve has opened: only the whole event tells a step from its flow.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
REMEMBERED = 0.95  # weight of the events before an event
CLIP = 4.0  # standard deviations for which an innovation counts at most, all else fitted


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
    """Sums over events by which a step at one time before the openings shows; empty before any.

    unclipped: (2, places), both sums without limits, which tell how high the step is, and where.
    """

    products: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    squares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    unclipped: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 0)))

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
