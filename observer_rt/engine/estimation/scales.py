"""Scales of the network's weights: curve by curve, s times the prior, weighed by marginal likelihood.

A belief has the whole prior, so that any law is learned when it comes. The carried theta has the likely scales: s is
`NONE`, `SMALL` or 1 for each curve along one input, and 1 or `NONE` for each along two, which are in use where they
pay (MacKay, Information Theory, Inference, and Learning Algorithms, chapter 28). Of the likely scales the mixture.
"""

import itertools
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.evidence import weigh_scales
from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.model.model import FIRST_OF_SEAT
from observer_rt.engine.estimation.belief import Belief, Matrix, Vector, symmetric
from observer_rt.engine.estimation.parameters import EVERY, SCALARS, WEIGHTS
from observer_rt.foundation.units import Bools, Ints
from observer_rt.model.network import IS_PAIR, NEURONS

LAWLESS, ONE_SCALE = 0.6, 0.5  # probability that a flow has no law; of one that has, that all curves are alike; M
PAIRED, MOST_PAIRS = 0.01, 3  # probability that a law goes by two inputs at once, each two; pairs in use at most; M
CHOICES, CHOSEN = 8, 0.99  # of scales that the weights are a mixture of: at most, and of all of their probability; I

# Of the prior: no law at all, small ones, any; 1 itself would be measured with infinite noise.
NONE, SMALL, WHOLE = 1e-3, 0.1, math.sqrt(0.999)
_PRIOR = SCALARS.prior(1.0)[WEIGHTS]
_SCALES = np.array([NONE, SMALL, WHOLE]) ** 2
_NOISES = _SCALES / (1.0 - _SCALES)
_ALONE = np.ones(1)
_CURVE = np.repeat(np.arange(NEURONS.size), NEURONS)  # of each weight
_PAIRS, _SINGLE = np.flatnonzero(IS_PAIR), np.flatnonzero(~IS_PAIR)
_OF_PAIR = np.array([np.flatnonzero(pair == _CURVE) for pair in _PAIRS])
_OF_SINGLE = np.flatnonzero(~IS_PAIR[_CURVE])
_OF_NOZZLE = int((_SINGLE < FIRST_OF_SEAT).sum())  # curves along one input
_CHOICES = np.array([*itertools.product(range(_SCALES.size), repeat=_SINGLE.size)])  # of a scale for each of them
_SQUARES = np.repeat(_SCALES[_CHOICES], NEURONS[_SINGLE], axis=1)
Pairs = frozenset[int]
"""Curves along two inputs that are in use."""


def _offered(scales: Ints) -> Vector:
    """Log priors (k,) of choices (k, curves) of a flow's scales; curves of a law often have one scale."""
    choices = _SCALES.size ** scales.shape[1] - 1
    one_scale = (scales == scales[:, :1]).all(axis=1) / (_SCALES.size - 1)
    lawful = (1.0 - LAWLESS) * (ONE_SCALE * one_scale + (1.0 - ONE_SCALE) / choices)
    return np.log(np.where(scales.any(axis=1), lawful, LAWLESS))


_ENDS = np.cumsum([0, *NEURONS[_SINGLE]])
_BEFORE = _offered(_CHOICES[:, :_OF_NOZZLE]) + _offered(_CHOICES[:, _OF_NOZZLE:])
_BEFORE -= 0.5 * np.log1p(-_SQUARES).sum(axis=1)


class ScaleChoice(NamedTuple):
    """Scales of all curves: row of `_CHOICES`, and the pairs in use."""

    row: int
    pairs: Pairs

    @property
    def noise(self) -> Vector:
        """Variances (HIDDEN,) of weights measured to be 0, in units of the prior's: s^2/(1 - s^2) for a scale s."""
        squares = np.where(_is_other(self.pairs), _SCALES[0], _SCALES[-1])
        squares[_OF_SINGLE] = _SQUARES[self.row]
        return np.asarray(squares / (1.0 - squares))

    def of(self, belief: Belief) -> Belief:
        """The belief with these scales, to fit an event from."""
        return _measured(belief, WEIGHTS, _PRIOR, self.noise[None], _ALONE, has_errors=False)


def _measured(
    belief: Belief, columns: Ints, prior: Vector, noises: Matrix, shares: Vector, has_errors: bool = True
) -> Belief:
    """Moments of the mixture of beliefs after weights in columns (k,) were measured to be 0.

    noises (c, k): variances by part, in units of the prior's; shares (c,): of the parts.
    """
    across, own = _in_units(belief.covariance, columns, prior)
    informations = np.array([_information(own, noise) for noise in noises])
    pulls = informations @ (belief.mean[columns] / prior)
    pull, shared = shares @ pulls, (shares[:, None, None] * informations).reshape(-1, columns.size)
    information = shared.reshape(informations.shape).sum(axis=0)
    away = pulls - pull
    between = (shares * away.T) @ away
    mean = belief.mean - pull @ across
    covariance = symmetric(belief.covariance - across.T @ ((information - between) @ across))
    if not has_errors:
        return Belief(mean, covariance, covariance)
    by_error, error = _in_units(belief.error_covariance, columns, prior)
    noisy = informations @ error + informations * noises[:, None, :]
    spread = noisy.transpose(1, 0, 2).reshape(columns.size, -1) @ shared + between
    moved = across.T @ (information @ by_error)
    error = belief.error_covariance - moved - moved.T + across.T @ (spread @ across)
    return Belief(mean, covariance, symmetric(error))


def _in_units(covariance: Matrix, columns: Ints, prior: Vector) -> tuple[Matrix, Matrix]:
    """Covariance (k, m) of weights with theta, in units of their prior, and their own (k, k)."""
    across = covariance[columns] / prior[:, None]
    return across, across[:, columns] / prior


def _information(own: Matrix, noise: Vector) -> Matrix:
    """Inverse (k, k) of the covariance of weights with their noise (k,), in units of their prior."""
    noisy = own.copy()
    noisy.ravel()[:: noise.size + 1] += noise
    return inverse_of(noisy)[0]


@lru_cache(32)
def _is_other(pairs: Pairs) -> Bools:
    return np.asarray(IS_PAIR[_CURVE] & ~np.isin(_CURVE, list(pairs)), np.bool_)


@lru_cache(32)
def _others(pairs: Pairs) -> Ints:
    return np.flatnonzero(_is_other(pairs))


def other_columns(pairs: Pairs) -> Ints:
    """Columns of theta that are weights of all pairs but these."""
    return WEIGHTS[_others(pairs)]


@lru_cache(32)
def _measured_in_turn(pairs: Pairs) -> tuple[Ints, Ints]:
    """Weights of all pairs but these, then those of curves along one input; where these and each of those end."""
    others = _others(pairs)
    return np.concatenate((others, _OF_SINGLE)), np.cumsum([others.size, *NEURONS[_SINGLE]])


def without_others(belief: Belief, pairs: Pairs) -> Belief:
    """The belief with no pairs but these, to fit an event from."""
    return _in_use(belief, pairs, has_errors=False).complete(columns_in_use(pairs), _without_law(pairs))


def _in_use(belief: Belief, pairs: Pairs, has_errors: bool = True) -> Belief:
    """The belief about the columns in use, the weights of all other pairs 0."""
    others = _others(pairs)
    noises = np.full((1, others.size), _NOISES[0])
    return _measured(belief, WEIGHTS[others], _PRIOR[others], noises, _ALONE, has_errors).part(columns_in_use(pairs))


@lru_cache(32)
def columns_in_use(pairs: Pairs) -> Ints:
    """Columns of theta but weights of all pairs but these."""
    return np.setdiff1d(EVERY, other_columns(pairs))


@lru_cache(32)
def _single_in_use(pairs: Pairs) -> Ints:
    """Weights of curves along one input among the columns in use."""
    return np.searchsorted(columns_in_use(pairs), WEIGHTS[_OF_SINGLE])


@lru_cache(32)
def _without_law(pairs: Pairs) -> Vector:
    """Variances (m,) of theta that are those of weights without a law, of all pairs but these; 0 elsewhere."""
    variances = np.zeros(EVERY.size)
    variances[other_columns(pairs)] = _NOISES[0] * _PRIOR[_others(pairs)] ** 2
    return variances


def weigh_choices(
    mean: Vector, covariance: Matrix, pairs: Pairs, log_priors: Vector | float = 0.0
) -> tuple[Vector, Vector]:
    """Logarithms (k,) of how likely each choice with these pairs is, and the mean (m,) at the likeliest.

    mean and covariance, in the columns in use, have the whole prior; log_priors (k,): beyond what `_BEFORE` says.
    Raises numpy.linalg.LinAlgError when not positive definite.
    """
    logs = _BEFORE + len(pairs) * math.log(PAIRED) + log_priors
    theta = np.zeros(EVERY.size)
    likeliest = weigh_scales(mean, covariance, _single_in_use(pairs), _PRIOR[_OF_SINGLE], _ENDS, _NOISES, logs)
    theta[columns_in_use(pairs)] = likeliest
    return logs, theta


def log_sum(logs: Vector) -> float:
    """Logarithm of the sum of numbers by their logarithms (k,)."""
    largest = float(logs.max())
    return largest + math.log(np.exp(logs - largest).sum())


def choices_by(belief: Belief, pairs: Pairs) -> Vector:
    """Logarithms (k,) of how likely each choice with these pairs is by a belief that has all."""
    weights, ends = _measured_in_turn(pairs)
    logs = _BEFORE + len(pairs) * math.log(PAIRED)
    weigh_scales(belief.mean, belief.covariance, WEIGHTS[weights], _PRIOR[weights], ends, _NOISES, logs)
    return logs


def _gains(mean: Vector, covariance: Matrix, choice: ScaleChoice) -> dict[int, float]:
    """Nats by which a choice is likelier with each of the other pairs, too: that its weights need not be 0."""
    _, own = _in_units(covariance, WEIGHTS, _PRIOR)
    information = _information(own, choice.noise)
    blocks = information[_OF_PAIR[:, :, None], _OF_PAIR[:, None, :]]
    pulls = (information @ (mean[WEIGHTS] / _PRIOR))[_OF_PAIR]
    squares = (pulls * np.linalg.solve(blocks, pulls[..., None])[..., 0]).sum(axis=1)
    gains = 0.5 * (squares - np.linalg.slogdet(blocks)[1]) + math.log(PAIRED)
    of_pairs = zip(_PAIRS.tolist(), gains.tolist(), strict=True)
    return {pair: gain for pair, gain in of_pairs if pair not in choice.pairs}


@lru_cache(8)
def _likely(belief: Belief) -> tuple[list[Pairs], Matrix]:
    """Pairs in use, where one after another pays, and probabilities (k, choices) of all choices with each of them."""
    pairs, tried, densities = frozenset[int](), list[Pairs](), list[Vector]()
    while True:
        logs = choices_by(belief, pairs)
        tried.append(pairs)
        densities.append(logs)
        gains = _gains(belief.mean, belief.covariance, ScaleChoice(int(np.argmax(logs)), pairs))
        pair = max(gains, key=lambda pair: gains[pair])
        if gains[pair] < 0.0 or len(pairs) == MOST_PAIRS:
            break
        pairs |= {pair}
    weights = np.exp(np.array(densities) - np.max(densities))
    return tried, np.asarray(weights / weights.sum())


def pairs_in_use(belief: Belief) -> Pairs:
    """Those of the likeliest choice."""
    tried, weights = _likely(belief)
    return tried[int(np.argmax(weights.max(axis=1)))]


def law_probabilities(belief: Belief) -> Vector:
    """Probability (curves,) that a flow goes by the inputs of each curve of the network."""
    tried, weights = _likely(belief)
    result = np.zeros(NEURONS.size)
    result[_SINGLE] = weights.sum(axis=0) @ (_CHOICES > 0)
    for pairs, weight in zip(tried, weights.sum(axis=1).tolist(), strict=True):
        result[list(pairs)] += weight
    return result


@lru_cache(8)
def shrink(belief: Belief) -> Belief:
    """The belief with weights of the likely scales: moments of the mixture over their likeliest choices."""
    tried, probabilities = _likely(belief)
    weights = probabilities.ravel()
    likely = np.flatnonzero(weights >= np.partition(weights, -CHOICES)[-CHOICES])
    order = likely[np.argsort(-weights[likely], kind="stable")][:CHOICES]
    order = order[: int(np.searchsorted(np.cumsum(weights[order]), CHOSEN)) + 1]
    shares = weights[order] / weights[order].sum()
    choices = [ScaleChoice(row, tried[number]) for number, row in zip(*divmod(order, len(_CHOICES)), strict=True)]
    pairs = frozenset().union(*(choice.pairs for choice in choices))
    kept, used = columns_in_use(pairs), np.flatnonzero(~_is_other(pairs))
    noises = np.array([choice.noise[used] for choice in choices])
    mixture = _measured(_in_use(belief, pairs), np.searchsorted(kept, WEIGHTS[used]), _PRIOR[used], noises, shares)
    return mixture.complete(kept, _without_law(pairs))
