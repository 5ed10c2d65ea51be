"""The colour of a bench's noise, found while the needle is shut, and noise that grows with the slope of pressure.

Samples taken at moments that are off by t show the pressure off by t dp/dt, from sample to sample another way. What a
model does not know on a slope is alike in neighbouring samples: fourth differences hide it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import NO_HIGH_PASS, high_passed, take_in_products
from observer_rt.engine.estimation.phases import BLOCKS, deviate
from observer_rt.engine.estimation.prediction_error import Whitening, forgetting_of
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.masks import DIFFERENCE
from observer_rt.engine.learning.disturbances.noise_levels import mask_of
from observer_rt.engine.learning.memory import Tracker
from observer_rt.engine.stream.standstill import Standstill

TIME_CONSTANTS = (2e-3, 0.66e-3, 0.245e-3, 0.095e-3)  # s, of the high passes to choose from
ORDERS = 20  # highest order of the autoregressive part
SEGMENT = 3e-3  # s, of rest without break from which on it tells a colour
REMEMBERED = 0.85  # weight of the events before an event
RAIL_MOTION = 0.66e-3  # s: what is slower is the rail's own motion
RAIL_BLOCK = 0.16e-3  # s: what is faster the line does not hear
LOUDEST = 4.0  # times the mean square of those before, or of the newest: no event counts for more, for it may be none
GONE = 30.0  # times the mean square of the newest: what was so loud before is over, and tells nothing of it
MARGIN = 12.0  # of the BIC: so much better than white noise must a colour be
QUIET = 0.7  # of the expected standard deviation
# Of the BIC, within which the fastest high pass is taken: hum that keeps step with the events is steeper elsewhere
# than at rest.
ABOUT_AS_GOOD = 20.0
# The BIC goes by single samples, which pink noise leaves almost white; events are judged by means of blocks. A filter
# that leaves more in these is none, if any leaves less: half-way to what is refused, with half of its certainty.
MOST_LEFT = 1.3
LEFT_SIGNIFICANT = 2.5
LAGS = ORDERS + max(BLOCKS)  # samples that the mean of a whitened block goes back


@dataclass(frozen=True, eq=False)
class Colour:
    """Of the innovations of a bench: the filter that makes them white, at a sample interval [s].

    sigma: standard deviation of what it leaves of them, in units of p_0.
    """

    whitening: Whitening
    interval: float
    sigma: float


class SlowRail(Tracker):
    """How strong the noise of the rail pressure is where the line hears it, older events counting less."""

    _squares: float
    _count: float

    def __init__(self, interval: float) -> None:
        """interval: of samples [s]."""
        self._forgetting = forgetting_of(RAIL_MOTION, interval)
        self._length = max(1, round(RAIL_BLOCK / interval))
        self._squares, self._count = 0.0, 0.0

    def add(self, segments: Sequence[NDArray[np.float64]]) -> None:
        """Take in an event's rail pressure, a stretch of rest each."""
        self._squares *= REMEMBERED
        self._count *= REMEMBERED
        for values in segments:
            passed = np.append(0.0, high_passed(values[1:], self._forgetting))
            blocks = passed[: passed.size // self._length * self._length].reshape(-1, self._length)
            self._squares += float(np.sum(blocks.mean(axis=1) ** 2)) * self._length
            self._count += len(blocks)

    @property
    def sigma(self) -> float:
        """Of the white noise that is as strong, a sample's; 0 without any rest."""
        return math.sqrt(self._squares / self._count) if self._count > 0.0 else 0.0


class OffsetSince:
    """Line over rail pressure at rest from one event to the next."""

    def __init__(self) -> None:
        self._samples, self._sum = 0, 0.0

    def after(self, standstill: Standstill) -> float | None:
        """Its mean since the event before [p_0], None without a sample; standstill: when an event ended."""
        total = standstill.samples * standstill.offset
        samples, offset = standstill.samples - self._samples, total - self._sum
        self._samples, self._sum = standstill.samples, total
        return offset / samples if samples > 0 else None


def resting_segments(window: Window, first: int, shortest: int) -> list[slice]:
    """Runs of samples of a window with the needle long shut, from sample `first` on, none shorter than `shortest`.

    What is masked ends them: it would tell the colour of gaps.
    """
    resting = window.resting & ~mask_of(window)
    resting[:first] = False
    changes = np.flatnonzero(np.diff(resting, prepend=False, append=False))
    return [
        slice(int(begin), int(end))
        for begin, end in zip(changes[::2], changes[1::2], strict=True)
        if end - begin >= shortest
    ]


class RestingNoise(Tracker):
    """What innovations at rest are like, older events counting less; from it the filter that makes them white."""

    _products: NDArray[np.float64]
    _by_lag: NDArray[np.float64]
    _count: float

    def __init__(self, interval: float) -> None:
        """interval: of samples [s]."""
        self._interval = interval
        self._choices = np.array(
            [NO_HIGH_PASS, *(forgetting_of(constant, interval) for constant in TIME_CONSTANTS)]
        )
        self._products = np.zeros((self._choices.size, ORDERS + 1, ORDERS + 1))
        self._by_lag = np.zeros((self._choices.size, LAGS))
        self._count = 0.0

    def add(self, segments: Sequence[NDArray[np.float64]]) -> None:
        """Take in an event's innovations [p_0], a stretch of rest each."""
        weight, before = self._weights(segments)
        self._products *= REMEMBERED * before
        self._by_lag *= REMEMBERED * before
        self._count *= REMEMBERED if before > 0.0 else 0.0
        for values in segments:
            take_in_products(values, weight, self._choices, self._products, self._by_lag)
            self._count += len(values) - ORDERS

    def _weights(self, segments: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
        """What makes up for how loud an event is: a factor of its innovations, and of the squares before it.

        By what the slowest high pass lets through: levels differ from event to event.
        """
        if not (segments and self._count > 0.0):
            return 1.0, 1.0
        passed = np.concatenate([high_passed(values, self._choices[1]) for values in segments])
        square, known = float(np.mean(passed**2)), float(self._products[1, 0, 0] / self._count)
        if not min(square, known) > 0.0:
            return 1.0, 1.0
        if known > GONE * square:
            return 1.0, 0.0
        return math.sqrt(min(1.0, LOUDEST * known / square)), min(1.0, LOUDEST * square / known)

    def colour(self, before: Colour | None, expected: float = 0.0) -> Colour | None:
        """The filter that explains them best by the BIC, None where white noise does about as well.

        before: what it was, and stays where too little was seen; expected: standard deviation of innovations by the
        noise levels [p_0]. What is much quieter is no noise but arithmetic, of a recording without noise.
        """
        if self._count <= 2 * ORDERS:
            return before
        if self._products[0, 0, 0] < self._count * (QUIET * expected) ** 2:
            return None
        variances = _residual_variances(self._products / self._count)
        parameters = np.arange(ORDERS + 1) + (self._choices[:, None] != NO_HIGH_PASS)
        criteria = self._count * np.log(variances) + math.log(self._count) * parameters
        if np.min(criteria) > criteria[0, 0] - MARGIN:
            return None
        orders, least = self._best_orders(criteria)
        choice = int(np.argmin(least))
        if choice > 0:
            choice = int(np.flatnonzero(least < least[choice] + ABOUT_AS_GOOD)[-1])
        order = orders[choice]
        forgetting = float(self._choices[choice]) if choice > 0 else None
        whitening = Whitening(forgetting, self._taps(choice, order))
        return Colour(whitening, self._interval, math.sqrt(variances[choice, order]))

    def _best_orders(self, criteria: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Of each high pass the order to take, and its BIC: the least of the filters that leave no colour.

        criteria: (choices, orders), BIC. Without such a filter those with.
        """
        orders, least = np.argmin(criteria, axis=1), np.full(len(criteria), np.inf)
        for choice, by_order in enumerate(criteria):
            for order in np.argsort(by_order):
                if not self._is_colour_left(choice, int(order)):
                    orders[choice], least[choice] = order, by_order[order]
                    break
        return orders, least if np.isfinite(least).any() else np.min(criteria, axis=1)

    def _is_colour_left(self, choice: int, order: int) -> bool:
        """Whether means of blocks of what a filter leaves vary more than they may."""
        filtering = np.append(1.0, self._taps(choice, order))
        one = self._variance_of(choice, filtering)
        for length in BLOCKS:
            colour = self._variance_of(choice, np.convolve(np.ones(length), filtering)) / (length * one)
            blocks = self._count / length
            if colour > MOST_LEFT and deviate(colour * blocks, blocks) > LEFT_SIGNIFICANT:
                return True
        return False

    def _variance_of(self, choice: int, weights: NDArray[np.float64]) -> float:
        """Of a weighted sum of neighbouring innovations behind a high pass."""
        products = np.correlate(weights, weights, "full")[weights.size - 1 :]
        products[1:] *= 2.0
        return float(products @ self._by_lag[choice, : weights.size]) / self._count

    def _taps(self, choice: int, order: int) -> NDArray[np.float64]:
        products = self._products[choice]
        return -np.linalg.solve(products[1 : order + 1, 1 : order + 1], products[1 : order + 1, 0])


_LAST_FIRST = np.array([*range(1, ORDERS + 1), 0])


def _residual_variances(covariances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the newest value, given none of those before it, one, .. all: (c, m) of covariances (c, m, m).

    Their first row is that of the newest.
    """
    factors = np.linalg.cholesky(covariances[:, _LAST_FIRST[:, None], _LAST_FIRST])
    explained = np.cumsum(factors[:, -1, :-1] ** 2, axis=1)
    variances = np.repeat(covariances[:, 0, :1], covariances.shape[1], axis=1)
    variances[:, 1:] -= explained
    return np.asarray(variances, np.float64)


SLOPE = np.array([3.0, 2.0, 1.0, 0.0, -1.0, -2.0, -3.0]) / 28.0  # of the straight line through seven samples
USUAL = 0.2  # samples, of a jitter by whose scatter the slopes are weighed
CLIP = 16.0  # variances for which one square counts at most: a spike is no jitter
# of the variance of a mean of squares of fourth differences, whose neighbours are alike, over that of white ones
ALIKE = 2.63
LENGTH = 8  # samples
JITTER_REMEMBERED = 0.9  # of the events before
FOUND, LOST = 8.0, 5.0  # standard deviations from which on there is one, and below which no more
RELEVANT = 0.1  # samples: less is not told from a noise that is white
MOST = 0.5  # samples: more is no jitter


class TimeJitter(Tracker):
    """Follows how much louder the line pressure is where it is steep, event after event."""

    _sums: NDArray[np.float64]
    _variance: float

    def __init__(self) -> None:
        self._sums = np.zeros(5)  # weights, with squared slopes and their squares, with loudness and both
        self._variance = 0.0

    @property
    def is_known(self) -> bool:
        """Whether the noise depends on the slope."""
        return self._variance > 0.0

    def levels(self, window: Window, sigma: float) -> NDArray[np.float64] | None:
        """Standard deviations (n,) of a window's innovations over that at rest, `sigma`; None: all are alike."""
        if not self.is_known:
            return None
        return np.sqrt(1.0 + self._variance * _squared_slopes(window, sigma))

    def loudest(self, window: Window, sigma: float) -> float:
        """Largest mean square of `levels` over as many samples as contradict a model; 1 where all are alike."""
        levels = self.levels(window, sigma)
        if levels is None:
            return 1.0
        return float(np.convolve(levels**2, np.full(LENGTH, 1.0 / LENGTH), "valid").max())

    def is_new_after(self, window: Window, unfiltered: NDArray[np.float64], sigma: float, first: int) -> bool:
        """Take in an event's innovations (n,) from `first` on, neither white nor weighed; whether it shows now."""
        counts = np.convolve(mask_of(window), np.ones(DIFFERENCE.size), "same") == 0.0
        counts[: first + DIFFERENCE.size] = False
        counts[-DIFFERENCE.size :] = False
        differences = np.convolve(unfiltered, DIFFERENCE, "same") / sigma
        squares = differences[counts] ** 2 / float(DIFFERENCE @ DIFFERENCE)
        slopes = _squared_slopes(window, sigma)[counts]
        expected = 1.0 + USUAL**2 * slopes
        loud = np.minimum(squares, CLIP * expected)
        weights = 1.0 / expected**2
        columns = np.ones_like(slopes), slopes, slopes**2, loud, slopes * loud
        self._sums = JITTER_REMEMBERED * self._sums + [float(weights @ column) for column in columns]
        was_known = self.is_known
        self._variance = self._found(LOST if was_known else FOUND)
        return self.is_known and not was_known

    def _found(self, needed: float) -> float:
        """Variance of the moments [samples^2], of a straight line through loudness over squared slope; 0: none."""
        count, slopes, squares, loud, both = self._sums
        information = squares - slopes**2 / count if count > 0.0 else 0.0
        if not information > 0.0:
            return 0.0
        variance = (both - slopes * loud / count) / information
        is_sure = variance * math.sqrt(information / (2.0 * ALIKE)) > needed
        return float(variance) if is_sure and RELEVANT**2 < variance < MOST**2 else 0.0


def _squared_slopes(window: Window, sigma: float) -> NDArray[np.float64]:
    """Of the recorded line pressure (n,), in `sigma` a sample, squared."""
    return np.asarray((np.convolve(window.output, SLOPE, "same") / sigma) ** 2, np.float64)
