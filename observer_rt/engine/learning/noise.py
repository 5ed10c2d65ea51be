"""Noise of an event: its colour, and stretches that may be off.

A high pass and an autoregressive filter make coloured innovations white. An event is weighed once more without a
stretch that is held or loud (`Window.masked`), and pays for that instead.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from observer_rt.core.learning.outliers import find_held, find_loud
from observer_rt.core.learning.whitening import NO_HIGH_PASS, high_passed, take_in_products, whiten
from observer_rt.engine.estimation.belief import Vector
from observer_rt.engine.estimation.phases import BLOCKS, deviate
from observer_rt.engine.estimation.predictor import Window
from observer_rt.foundation.units import Bools, Floats, Ints

GAUSSIAN = 1.4826  # standard deviation over the median of the sizes
FEWEST = 16  # samples that tell a level
NEIGHBOURS = 5  # samples whose mean is compared with an end of the range
AT, BEYOND = 1.5, 3.0  # standard deviations of a sample, within which it is there, and beyond which there is none
MOST = 0.35  # share of an event that may be off; beyond it its noise, or its model, is just not known
TIME_CONSTANTS = (2e-3, 0.66e-3, 0.245e-3, 0.095e-3)  # s, of the high passes to choose from
ORDERS = 20  # highest order of the autoregressive part
SEGMENT = 3e-3  # s, of rest without break from which on it tells a colour
REMEMBERED = 0.85  # weight of the events before an event
LOUDEST = 4.0  # times the mean square of those before, or of the newest: no event counts for more, for it may be none
GONE = 30.0  # times the mean square of the newest: what was so loud before is over, and tells nothing of it
MARGIN = 12.0  # of the BIC: so much better than white noise must a colour be
QUIET = 0.7  # of the expected standard deviation
ABOUT_AS_GOOD = 20.0  # BIC within which the fastest high pass is taken: hum in step with events is steep
# The BIC goes by samples, which pink noise leaves almost white; events go by means of blocks. A filter that leaves
# more in these is out if any leaves less: half-way to a refusal, with half its certainty.
MOST_LEFT, LEFT_SIGNIFICANT = 1.3, 2.5
LOWEST = 30.0  # Hz, of noise that an injection shows: hum is an offset that comes and goes
LAGS = ORDERS + max(BLOCKS)  # samples that the mean of a whitened block goes back
_HIGH_PASSES = 1 + len(TIME_CONSTANTS)
_LAST_FIRST = np.array([*range(1, ORDERS + 1), 0])
NONE_MASKED = np.empty(0, np.bool_)


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations, in units of p_0: of the innovations, and of the line pressure's noise."""

    innovation: float
    noise: float


@dataclass(frozen=True, eq=False)
class CleanWindow:
    """An event without its stretches that are off: the window, and nats of their samples as what they are."""

    window: Window
    nats: float


def loudness(window: Window, innovations: Vector, sigmas: Sigmas, first: int) -> float:
    """Factor, 1 at least, by which most innovations (n,) at rest, from `first` on, exceed their sigma."""
    resting = innovations[first:][window.resting[first:]]
    if resting.size < FEWEST:
        return 1.0
    return max(1.0, GAUSSIAN * median(np.abs(resting)) / sigmas.innovation)


def median(values: Vector) -> float:
    """Median of finite values (n,); numpy's own looks for others first, which takes thrice as long."""
    middle = values.size // 2
    parted = np.partition(values, middle)
    above = float(parted[middle])
    return above if values.size % 2 else 0.5 * (float(parted[:middle].max()) + above)


def mask_of(window: Window) -> Bools:
    """Samples of a window (n,) that do not count."""
    return window.masked if len(window.masked) else np.zeros(len(window.output), np.bool_)


def without_stretches(window: Window, innovations: Vector, sigmas: Sigmas, first: int) -> CleanWindow | None:
    """The event without samples better explained as held or loud than by their innovations (n,), or None."""
    before = mask_of(window)
    louder = loudness(window, innovations, sigmas, first)
    sigmas = Sigmas(louder * sigmas.innovation, louder * sigmas.noise)
    held = find_held(window.output, innovations / sigmas.innovation, before, sigmas.noise, first)
    spans = np.concatenate((held, find_loud(window.output, sigmas.noise)))
    mask = before.copy()
    for start, end in spans[:, :2].astype(np.int64):
        mask[start:end] = True
    for start, end in held[:, :2].astype(np.int64):
        mask |= _beyond(window.output, float(np.mean(window.output[start:end])), sigmas.noise)
    masked = np.count_nonzero(mask & ~before)
    if not 0 < masked <= MOST * mask.size:
        return None
    more = masked - float(np.sum(spans[:, 1] - spans[:, 0]))
    return CleanWindow(window._replace(masked=mask), float(spans[:, 2].sum()) + max(0.5 * more, 0.0))


def _beyond(y: Vector, level: float, noise: float) -> Bools:
    """Samples of y (n,) about a level at which its range ends; none, where it goes on beyond it."""
    means = np.convolve(y - level, np.full(NEIGHBOURS, 1.0 / NEIGHBOURS), "same")
    inner = means[NEIGHBOURS:-NEIGHBOURS] / noise
    sign = 1.0 if inner.max() < BEYOND else -1.0
    if (sign * inner).max() >= BEYOND:
        return np.zeros(y.size, np.bool_)
    at = sign * means > -AT * noise
    return np.asarray(np.convolve(at, np.ones(NEIGHBOURS), "same") > 0.5, np.bool_)


@dataclass(frozen=True, eq=False)
class Whitening:
    """The filter (1 - z)/(1 - theta z) (1 + a_1 z + .. + a_p z^p), z the delay of one sample."""

    forgetting: float | None  # theta; None: no high pass
    taps: Floats  # a (p,)

    def of(self, values: Floats, masked: Bools = NONE_MASKED) -> Floats:
        """Innovations (n,), or slopes (n, m), whitened: linear, the same for both; the first value becomes 0.

        masked (n,), or (0,): where the expected value stands in, with 0 out until all taps lie on values again.
        """
        columns = values.reshape(values.shape[0], -1)
        result = np.empty_like(columns)
        whiten(columns, masked, NO_HIGH_PASS if self.forgetting is None else self.forgetting, self.taps, result)
        return result.reshape(values.shape)


@dataclass(frozen=True, eq=False)
class Colour:
    """Colour of a bench's innovations."""

    whitening: Whitening  # filter that makes them white
    interval: float  # of the samples [s]
    sigma: float  # standard deviation of what the filter leaves [p_0]

    @property
    def loudest(self) -> float:
        """Variance [p_0^2] of white noise as loud as these are where they are loudest, from `LOWEST` on."""
        delayed = np.exp(-2j * np.pi * self.interval * np.geomspace(LOWEST, 0.5 / self.interval))
        passed = delayed[:, None] ** np.arange(1 + self.whitening.taps.size) @ np.append(1.0, self.whitening.taps)
        if self.whitening.forgetting is not None:
            passed *= (1.0 - delayed) / (1.0 - self.whitening.forgetting * delayed)
        return float((self.sigma / np.abs(passed).min()) ** 2)


def is_same(first: Colour | None, second: Colour | None) -> bool:
    """Whether two colours are equal, or both absent."""
    if first is None or second is None or first is second:
        return first is second
    numbers = [(of.sigma, of.interval, of.whitening.forgetting, *of.whitening.taps) for of in (first, second)]
    return numbers[0] == numbers[1]


def resting_segments(window: Window, first: int, shortest: int) -> list[slice]:
    """Slices from `first` on, at least `shortest` long, with the needle long shut; masked samples end them."""
    resting = np.zeros(window.resting.size + 2, np.bool_)  # no sample rests before the first, nor after the last
    resting[1 + first : -1] = window.resting[first:]
    resting[1:-1][mask_of(window)] = False
    changes = np.flatnonzero(resting[1:] != resting[:-1]).tolist()
    spans = zip(changes[::2], changes[1::2], strict=True)
    return [slice(begin, end) for begin, end in spans if end - begin >= shortest]


@lru_cache
def _choices(interval: float) -> Floats:
    """Shares that the high passes to choose from leave from one sample to the next, none first."""
    return np.array([NO_HIGH_PASS, *(math.exp(-interval / constant) for constant in TIME_CONSTANTS)])


@dataclass(frozen=True, eq=False)
class RestingNoise:
    """Statistics of innovations at rest by high pass and lag, from which comes the filter that makes them white."""

    products: Floats = field(default_factory=lambda: np.zeros((_HIGH_PASSES, ORDERS + 1, ORDERS + 1)))
    by_lag: Floats = field(default_factory=lambda: np.zeros((_HIGH_PASSES, LAGS)))
    count: float = 0.0

    def after(self, segments: Sequence[Floats], interval: float) -> "RestingNoise":
        """Adds an event's innovations [p_0], a stretch of rest each; interval: of samples [s]."""
        choices = _choices(interval)
        weight, before = self._weights(segments, choices)
        products, by_lag = (sums * (REMEMBERED * before) for sums in (self.products, self.by_lag))
        count = self.count * (REMEMBERED if before > 0.0 else 0.0)
        for values in segments:
            take_in_products(values, weight, choices, products, by_lag)
            count += len(values) - ORDERS
        return RestingNoise(products, by_lag, count)

    def _weights(self, segments: Sequence[Floats], choices: Floats) -> tuple[float, float]:
        """Factors that make up for loudness, which differs by event: of its innovations, and of squares before it."""
        if not (segments and self.count > 0.0):
            return 1.0, 1.0
        passed = np.concatenate([high_passed(values, choices[1]) for values in segments])
        square, variance = float(np.mean(passed**2)), float(self.products[1, 0, 0] / self.count)
        if not min(square, variance) > 0.0:
            return 1.0, 1.0
        if variance > GONE * square:
            return 1.0, 0.0
        return math.sqrt(min(1.0, LOUDEST * variance / square)), min(1.0, LOUDEST * square / variance)

    def colour(self, before: Colour | None, interval: float, expected: float = 0.0) -> Colour | None:
        """Filter that explains the innovations best by the BIC, None where white noise does about as well.

        `before` stays where too little was seen; interval [s] of samples; expected: standard deviation by the noise
        levels [p_0]: much quieter values are arithmetic of a recording without noise.
        """
        if self.count <= 2 * ORDERS:
            return before
        if self.products[0, 0, 0] < self.count * (QUIET * expected) ** 2:
            return None
        choices = _choices(interval)
        variances = _residual_variances(self.products / self.count)
        parameters = np.arange(ORDERS + 1) + (choices[:, None] != NO_HIGH_PASS)
        criteria = self.count * np.log(variances) + math.log(self.count) * parameters
        if np.min(criteria) > criteria[0, 0] - MARGIN:
            return None
        orders, least = self._best_orders(criteria)
        choice = int(np.argmin(least))
        if choice > 0:
            choice = int(np.flatnonzero(least < least[choice] + ABOUT_AS_GOOD)[-1])
        order = orders[choice]
        forgetting = float(choices[choice]) if choice > 0 else None
        whitening = Whitening(forgetting, self._taps(choice, order))
        return Colour(whitening, interval, math.sqrt(variances[choice, order]))

    def _best_orders(self, criteria: Floats) -> tuple[Ints, Floats]:
        """Best order of each high pass by criteria (choices, orders), and its BIC: without a colour left, if any."""
        orders, least = np.argmin(criteria, axis=1), np.full(len(criteria), np.inf)
        for choice, by_order in enumerate(criteria):
            for order in np.argsort(by_order):
                if not self._is_colour_left(choice, int(order)):
                    orders[choice], least[choice] = order, by_order[order]
                    break
        return orders, least if np.isfinite(least).any() else np.min(criteria, axis=1)

    def _is_colour_left(self, choice: int, order: int) -> bool:
        """True if means of blocks behind a filter vary more than they may."""
        filtering = np.append(1.0, self._taps(choice, order))
        variance = self._variance_of(choice, filtering)
        for length in BLOCKS:
            colour = self._variance_of(choice, np.convolve(np.ones(length), filtering)) / (length * variance)
            blocks = self.count / length
            if colour > MOST_LEFT and deviate(colour * blocks, blocks) > LEFT_SIGNIFICANT:
                return True
        return False

    def _variance_of(self, choice: int, weights: Floats) -> float:
        products = np.correlate(weights, weights, "full")[weights.size - 1 :]
        products[1:] *= 2.0
        return float(products @ self.by_lag[choice, : weights.size]) / self.count

    def _taps(self, choice: int, order: int) -> Floats:
        products = self.products[choice]
        return -np.linalg.solve(products[1 : order + 1, 1 : order + 1], products[1 : order + 1, 0])


def _residual_variances(covariances: Floats) -> Floats:
    """Variances (c, m) of the newest value, given none of those before it, one, .., by covariances (c, m, m)."""
    factors = np.linalg.cholesky(covariances[:, _LAST_FIRST[:, None], _LAST_FIRST])
    explained = np.cumsum(factors[:, -1, :-1] ** 2, axis=1)
    variances = np.repeat(covariances[:, 0, :1], covariances.shape[1], axis=1)
    variances[:, 1:] -= explained
    return np.asarray(variances, np.float64)
