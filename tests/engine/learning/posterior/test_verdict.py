"""The verdict on a mass: known to 3 %, at three standard deviations of what its event says."""

from typing import Any

import numpy as np
import pytest

from observer_rt.engine.estimation.belief import prior_belief
from observer_rt.engine.estimation.scalars import SCALARS, Parameter
from observer_rt.engine.learning.account import Account
from observer_rt.engine.learning.hypotheses import BEFORE
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.engine.learning.posterior.event import ExplainedEvent
from observer_rt.engine.learning.posterior.event_mass import EventMass
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.outcome import Shares, verdict_of
from observer_rt.engine.stream.state import Reason

WIDE = SCALARS.prior(1e8)
NEW = LearnedInjector(prior_belief(0.0 * WIDE, np.diag(WIDE**2)), 0.0 * WIDE)
NONE: Any = None


@pytest.mark.parametrize(
    ("shares", "reasons"),
    [
        (Shares(0.0005, 0.001, 0.0), []),
        (Shares(0.0099, 0.0099, 0.02), []),
        (Shares(0.011, 0.012, 0.0), [Reason.OUTSIDE_LEARNED_RANGE]),
        (Shares(0.004, 0.012, 0.0), [Reason.OUTSIDE_LEARNED_RANGE]),
    ],
)
def test_a_mass_is_valid_that_is_known_to_three_percent(shares: Shares, reasons: list[Reason]) -> None:
    by_nozzle = np.eye(WIDE.size)[Parameter.NOZZLE_BIAS]
    mass = EventMass(NONE, NONE, NEW.theta, 1e-8, by_nozzle, 0.0, 1)
    explanation = Explanation(NEW, BEFORE, 0.0, NONE, NONE, NONE, NONE, NONE, NEW.theta, None, None, 1.0)
    explained = ExplainedEvent(NONE, NONE, NONE, NONE, [(explanation, NEW)], explanation, Account(NEW))
    verdict = verdict_of(explained, mass, shares, (), WIDE)
    assert [objection.reason for objection in verdict.own] == reasons
    assert not verdict.forward
