"""Evidence of an event for a prior: its marginal likelihood, in closed form where its cost is a parabola.

MacKay, Information Theory, Inference, and Learning Algorithms, chapter 28: the best fit, less what a prior pays for
its width.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.evidence import integrate_cost
from observer_rt.engine.estimation.gating import Belief
from observer_rt.engine.estimation.prediction_error import Linearisation
from observer_rt.engine.estimation.scalars import Theta
from observer_rt.engine.learning.account.constants import BEYOND
from observer_rt.engine.learning.fitting import Limits


class Evidence(NamedTuple):
    """Logarithm of the marginal likelihood, but for what all priors share, and the mean (m,) of theta after it."""

    log: float
    theta: Theta


def evidences(cost: Linearisation, priors: Sequence[Belief], limits: Limits) -> list[Evidence]:
    """Integrates exp(-cost) over Gaussian priors, the cost a parabola round where it was linearised.

    What that promises beyond the limits, or further off than slopes hold, is fiction: no more than `BEYOND` of it
    counts. Raises numpy.linalg.LinAlgError when singular.
    """
    thetas, results = integrate_cost(cost, limits, priors)
    widths, least, allowed = results.T
    logs = -np.maximum(least, allowed - BEYOND) - widths
    return [Evidence(log, theta) for log, theta in zip(logs.tolist(), thetas, strict=True)]
