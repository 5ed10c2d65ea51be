"""Shrinks the network's weights towards 0, as far as no law of nozzle or seat was seen.

A belief has the whole prior, so that any law is learned when it comes. The carried theta has the likely scale, s
times the prior, of nozzle and seat each by itself: s is `SMALL` or 1, weighed by marginal likelihood (MacKay,
Information Theory, Inference, and Learning Algorithms, chapter 28).
"""

import itertools
from functools import lru_cache

import numpy as np

from observer_rt.core.learning.gating import inverse_of
from observer_rt.engine.estimation.gating import Belief, symmetric
from observer_rt.engine.estimation.scalars import SCALARS, WEIGHTS
from observer_rt.model.network import HIDDEN, OF_NOZZLE

SMALL = 0.1  # of the prior: what healthy and evenly worn injectors leave
_WHOLE = 0.999  # of its variance: 1, but for the infinite noise
_PRIOR = SCALARS.prior(1.0)[WEIGHTS]
_SQUARES = np.repeat(
    [*itertools.product((SMALL**2, _WHOLE), repeat=2)], (OF_NOZZLE, HIDDEN - OF_NOZZLE), axis=1
)
_ALL = np.arange(HIDDEN)


@lru_cache(8)
def shrink(belief: Belief) -> Belief:
    """The belief with weights of the likely scales. Raises numpy.linalg.LinAlgError when not positive definite.

    A prior smaller by s is the whole one after each weight was measured to be 0 with s^2/(1 - s^2) of its variance; s
    is as likely as that. The mean of s^2 is taken: what no event excited varies as the mixture of all scales does.
    """
    across = belief.covariance[WEIGHTS] / _PRIOR[:, None]
    variance, mean = across[:, WEIGHTS] / _PRIOR, belief.mean[WEIGHTS] / _PRIOR
    bordered = np.empty((len(_SQUARES), HIDDEN + 1, HIDDEN + 1))
    bordered[:, :HIDDEN, :HIDDEN] = variance
    bordered[:, _ALL, _ALL] += _SQUARES / (1.0 - _SQUARES)
    bordered[:, HIDDEN, :HIDDEN] = mean  # the last row of the root is the mean, made white
    bordered[:, HIDDEN, HIDDEN] = 1.0 + 2.0 * mean @ mean / SMALL**2
    roots = np.linalg.cholesky(bordered)[:, :, :HIDDEN]
    densities = -0.5 * (np.log1p(-_SQUARES) + roots[:, HIDDEN] ** 2) - np.log(roots[:, _ALL, _ALL])
    weights = np.exp(densities.sum(axis=1) - densities.sum(axis=1).max())
    squares = weights @ _SQUARES / weights.sum()
    variance[_ALL, _ALL] += (noise := squares / (1.0 - squares))
    gain = (inverse_of(variance)[0] @ across).T
    by_error = gain @ (belief.error_covariance[WEIGHTS] / _PRIOR[:, None])
    error = belief.error_covariance - by_error - by_error.T
    error += (by_error[:, WEIGHTS] / _PRIOR + gain * noise) @ gain.T
    return Belief(belief.mean - gain @ mean, symmetric(belief.covariance - gain @ across), symmetric(error))
