"""The verdict: a mass is known to 3 %, and when the needle moves; control flow; what a bad event leaves."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.belief import prior_belief
from observer_rt.engine.estimation.scalars import SCALARS, Parameter
from observer_rt.engine.learning.account import Account, LearnedInjector
from observer_rt.engine.learning.hypotheses import AT_FAULT, BEFORE
from observer_rt.engine.learning.posterior.event import BeliefUpdate, ExplainedEvent
from observer_rt.engine.learning.posterior.event_mass import EventMass
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.outcome import Shares, verdict_of
from observer_rt.engine.stream.state import Reason
from observer_rt.model.effective import LAG_UNIT
from observer_rt.model.effects import effective_model, sized

WIDE = SCALARS.prior(1e8)
NEW = LearnedInjector(prior_belief(0.0 * WIDE, np.diag(WIDE**2)), 0.0 * WIDE)
NONE: Any = None


@pytest.mark.parametrize(
    ("shares", "odds", "later", "reasons"),
    [
        (Shares(0.0005, 0.001, 0.0), 0.01, 30e-6, []),
        (Shares(0.0099, 0.0099, 0.02), 0.01, 30e-6, []),
        (Shares(0.011, 0.012, 0.0), 0.01, 30e-6, [Reason.OUTSIDE_LEARNED_RANGE]),
        (Shares(0.004, 0.012, 0.0), 0.01, 30e-6, [Reason.OUTSIDE_LEARNED_RANGE]),
        (Shares(0.0005, 0.001, 0.0), 0.2, 30e-6, [Reason.TIME_BASE]),
        (Shares(0.0005, 0.001, 0.0), 0.2, 5e-6, []),
    ],
)
def test_known_masses_are_valid(shares: Shares, odds: float, later: float, reasons: list[Reason]) -> None:
    """A mass known to three percent, with no rival whose needle opens later [s]."""
    theta = later / LAG_UNIT * np.eye(WIDE.size)[Parameter.OPENING_DELAY]
    rival = Account(replace(NEW, theta=theta), log_odds=math.log(odds))
    assert _objections(NEW, shares, rival) == reasons


LAG, BOUNCE = int(Parameter.SENSOR_LAG), int(Parameter.LANDING_BOUNCE)


@pytest.mark.parametrize(
    ("lag", "active", "by_commands", "is_first", "is_doubted"),
    [
        (20e-6, [LAG], True, False, True),
        (20e-6, [LAG], True, True, False),
        (20e-6, [LAG], False, False, False),
        (40e-6, [LAG, BOUNCE], True, False, False),
        (0.0, [BOUNCE], True, False, True),
        (0.0, [BOUNCE], True, True, False),
    ],
)
def test_a_small_lag_is_as_likely_none_and_a_bounce_with_a_rival_as_likely_a_lag(
    lag: float, active: list[int], by_commands: bool, is_first: bool, is_doubted: bool
) -> None:
    theta = lag / LAG_UNIT * np.eye(WIDE.size)[LAG]
    learned = replace(NEW, theta=theta, active=frozenset(active), is_prior=is_first)
    rival = Account(replace(NEW, active=frozenset([LAG])), log_odds=-14.0)
    assert _objections(learned, Shares(0.0005, 0.001, 0.0), rival, by_commands) == [Reason.TIME_BASE] * is_doubted


def _objections(
    learned: LearnedInjector, shares: Shares, rival: Account | None, by_commands: bool = True
) -> list[Reason]:
    """Objections to the mass of an event that is as before; nothing is held against the next one."""
    mass = EventMass(NONE, NONE, learned.theta, 1e-8, np.eye(WIDE.size)[Parameter.NOZZLE_BIAS], 0.0, 1)
    reading: Any = SimpleNamespace(window=SimpleNamespace(needle=object() if by_commands else None))
    explanation = Explanation(learned, BEFORE, 0.0, reading, NONE, NONE, NONE, NONE, learned.theta, None, None, 1.0)
    account = Account(learned, rival=rival)
    explained = ExplainedEvent(NONE, NONE, NONE, NONE, [(explanation, learned)], explanation, account)
    verdict = verdict_of(explained, mass, shares, (), WIDE)
    assert not verdict.forward
    return [objection.reason for objection in verdict.own]


def test_a_bad_event_ages_what_was_learned_and_teaches_nothing_else() -> None:
    aged = prior_belief(0.0 * WIDE, 2.0 * np.diag(WIDE**2))
    for learned, belief in ((replace(NEW, is_prior=False), aged), (NEW, NEW.belief)):
        explanation = Explanation(learned, AT_FAULT, 0.0, NONE, aged, NONE, NONE, NONE, NEW.theta, None, None, 1.0)
        assert BeliefUpdate(NONE, NONE, NONE).after(explanation).belief is belief


def test_the_control_flow_of_an_event_is_that_of_its_open_needle() -> None:
    """4 mm3/ms at 100 MPa for a millisecond, over 50 mm3."""
    inputs = np.tile([1.0, 0.0], (200, 1))
    inputs[50:150, 1] = 1e-6
    model = effective_model(load_injector(), (sized("control_flow", c=4e-6),)).coefficients
    window: Any = SimpleNamespace(inputs=inputs)
    setting: Any = SimpleNamespace(coefficients=model, interval=1e-5)
    mass = EventMass(window, setting, NEW.theta, 50e-9, NEW.theta, 0.0, 1)
    assert mass.controlled == pytest.approx(0.08, rel=0.05)
