"""Evidence of an event for a prior: its marginal likelihood, in closed form where its cost is a parabola.

MacKay, Information Theory, Inference, and Learning Algorithms, chapter 28: the best fit, less what a prior pays for
its width.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief
from observer_rt.engine.estimation.prediction_error import Linearisation
from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.account.constants import BEYOND
from observer_rt.engine.learning.fitting import Limits


class Evidence(NamedTuple):
    """Logarithm of the marginal likelihood, but for what all priors share, and the mean (m,) of theta after it."""

    log: float
    theta: Theta


def evidence(cost: Linearisation, prior: Belief, limits: Limits) -> Evidence:
    """Evidence for one prior, as below."""
    return evidences(cost, [prior], limits)[0]


def evidences(cost: Linearisation, priors: Sequence[Belief], limits: Limits) -> list[Evidence]:
    """Integrates exp(-cost) over Gaussian priors, the cost a parabola round where it was linearised.

    What that promises beyond the limits, or further off than slopes hold, is fiction: no more than `BEYOND` of it
    counts. Raises numpy.linalg.LinAlgError when singular.
    """
    means, covariances = (
        np.array([getattr(prior, part) for prior in priors]) for part in ("mean", "covariance")
    )
    gradients = cost.gradient + (means - cost.theta) @ cost.information
    roots = np.linalg.cholesky(covariances)
    across = roots.swapaxes(1, 2)
    inner = np.linalg.cholesky(np.eye(cost.theta.size) + across @ cost.information @ roots)
    steps = np.linalg.solve(inner, across @ gradients[:, :, None])
    thetas = means - (roots @ np.linalg.solve(inner.swapaxes(1, 2), steps))[:, :, 0]
    widths = np.log(np.diagonal(inner, axis1=1, axis2=2)).sum(axis=1)  # what the priors pay for them
    least = _expected(cost, means) - 0.5 * (steps * steps).sum(axis=(1, 2))  # of cost and distance together
    away = thetas - cost.theta
    reach = np.maximum(1.0, np.max(np.abs(away) / limits.longest_step, axis=1))
    allowed = np.clip(cost.theta + away / reach[:, None], limits.lowest, limits.highest)
    tried = np.stack((allowed, np.broadcast_to(cost.theta, allowed.shape)), axis=2)
    distances = np.linalg.solve(roots, tried - means[:, :, None])
    totals = 0.5 * (distances * distances).sum(axis=1)
    totals += np.stack((_expected(cost, allowed), np.full(len(priors), cost.value)), axis=1)
    least = np.maximum(least, totals.min(axis=1) - BEYOND)
    return [Evidence(float(log), theta) for log, theta in zip(-least - widths, thetas, strict=True)]


def _expected(cost: Linearisation, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
    """The cost at thetas (k, m), (k,)."""
    steps = thetas - cost.theta
    return np.asarray(
        cost.value + steps @ cost.gradient + 0.5 * ((steps @ cost.information) * steps).sum(axis=1)
    )
