"""What couples into the line pressure when the coil is energized: a step at the same time before every opening.

The needle is shut then and nothing moves, so the model has nothing to say to it, however small it is; over many
events it stands out of the noise. While it lasts, it would be taken for wear.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.foundation.compiled import compiled

LONGEST_DELAY = 0.45e-3  # s, from the start of energizing to the opening
SHORTEST_DELAY = 0.12e-3
BEFORE_OPENING = (
    0.06e-3  # s that do not count: a lift that is recorded late lets the line pressure fall in them
)
CLIP = 3.0  # standard deviations for which an innovation counts at most: one event alone is an outlier
SEEN_FOR = 0.25e-3  # s, until x~ has taken a step for its own
REMEMBERED = 0.95  # weight of the events before an event
STANDS_OUT = 4.5  # standard deviations
OF_ONE_EVENT = 4.0  # of these at most, so that it must recur
COMMON = 0.6  # of it, up to which steps may stand out that are no edge: then the standstill is not understood at all


@dataclass(frozen=True)
class Edge:
    """A step of a height [p_0] so many samples before the openings."""

    height: float
    before: int


class EdgeSearch:
    """Looks for a step at one time before the openings, event after event."""

    def __init__(self, interval: float) -> None:
        """interval: of samples [s]."""
        self._shortest, self.longest, self._seen_for, self._beside = (
            round(duration / interval)
            for duration in (SHORTEST_DELAY, LONGEST_DELAY, SEEN_FOR, BEFORE_OPENING)
        )
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
        clipped = np.clip(innovations[:opening] / sigma, -CLIP, CLIP)
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


@compiled
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
    n = innovations.shape[0]
    for place in range(shortest, min(products.shape[0], n)):
        for i in range(min(place - beside, shape.shape[0])):
            products[place] += innovations[n - place + i] * shape[i]
            squares[place] += shape[i] * shape[i]


def with_step(window: Window, first: int, height: float) -> Window:
    """A window with a step of the line pressure [p_0] from sample `first` on."""
    output = window.output.copy()
    output[first:] += height
    return window._replace(output=output)
