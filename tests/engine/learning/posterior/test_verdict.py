"""The verdict on a published mass: right to 3 %, at three standard deviations of what its event says."""

from typing import Any

import numpy as np
import pytest

from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.scalars import SCALARS, Parameter
from observer_rt.engine.learning.hypotheses import BEFORE, Possibility
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.engine.learning.posterior.event import ExplainedEvent
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.outcome import EventMass, Shares, verdict_of
from observer_rt.engine.stream.state import Reason

WIDE = SCALARS.prior(1e8)
NEW = LearnedInjector(prior_belief(0.0 * WIDE, np.diag(WIDE**2)), 0.0 * WIDE)
NONE: Any = None


@pytest.mark.parametrize(
    ("published", "shares", "reasons"),
    [
        (0.018, Shares(0.0005, 0.001), []),
        (0.0136, Shares(0.0049, 0.0067), [Reason.REVISED]),
        (0.0, Shares(0.011, 0.012), [Reason.OUTSIDE_LEARNED_RANGE]),
        (0.0, Shares(0.004, 0.012), [Reason.MODEL_INADEQUATE]),
    ],
)
def test_the_further_off_the_surer(published: float, shares: Shares, reasons: list[Reason]) -> None:
    by_nozzle = np.eye(WIDE.size)[Parameter.NOZZLE_BIAS]
    mass = EventMass(NONE, NONE, NEW.theta, 1e-8, by_nozzle, 0.0, 1)
    so = Possibility(0.0, NEW)
    explanation = Explanation(so, BEFORE, 0.0, NONE, NONE, NONE, NONE, NEW.theta, None, None, 1.0)
    explained = ExplainedEvent(NONE, NONE, NONE, NONE, NONE, *[[(explanation, so)]] * 2)
    verdict = verdict_of(explained, mass, shares, published * by_nozzle, (), WIDE)
    assert [objection.reason for objection in (*verdict.forward, *verdict.own)] == reasons
