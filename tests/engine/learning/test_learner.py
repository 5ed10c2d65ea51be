"""Learning, one event at a time: estimates that are adopted, kept, refused, and taken over."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.belief import Belief, prior_belief
from observer_rt.engine.estimation.parameters import PARAMETERS, SCALARS, Parameter, network_of
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.knowledge import Account, Adoption, Knowledge, LearningState, no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.observer import Durations, constants_for, make_observer
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.foundation.records import from_plain, to_plain
from tests.engine.conftest import changes_of_flows
from tests.engine.learning.strokes import CONSTANTS, stroke_of
from tests.engine.sample_stream import NOISE, NOMINAL, judge

Vector = NDArray[np.float64]
NO_STANDSTILL = Standstill(samples=0, offset=0.0, noise=None)


def nozzle_wear(v_h: float) -> Vector:
    theta = np.zeros(PARAMETERS)
    theta[Parameter.NOZZLE_BIAS] = v_h
    return theta


def wear_of(theta: Vector) -> float:
    """v_H that theta means with the needle open at 95 MPa: bias and hidden neurons share it."""
    return float(changes_of_flows((0.9, 1.0, 0.8), (0.95, 0.9, 1e-3), network_of(theta))[0])


def event(v_h: float, seed: int | None = None) -> Window:
    return stroke_of(network=network_of(nozzle_wear(v_h)), seed=seed)


def knowledge_with(belief: Belief, in_force: Vector) -> Knowledge:
    fresh = no_knowledge(NOISE, NOMINAL.scaling.pressure)
    learned = replace(fresh.state.learned, belief=belief, theta=in_force, is_prior=False)
    return Knowledge(replace(fresh.state, account=Account(learned), events=5), in_force, phi_version=3)


def learner_with(belief: Belief, in_force: Vector) -> Learner:
    return Learner(CONSTANTS, knowledge_with(belief, in_force))


def belief_in(v_h: float, sigma: float) -> Belief:
    return prior_belief(nozzle_wear(v_h), np.diag(np.minimum(SCALARS.prior(NOMINAL.scaling.pressure), sigma) ** 2))


def test_adopted_phi_takes_force() -> None:
    learner = learner_with(belief_in(0.0, 0.3), nozzle_wear(0.0))
    observer = make_observer(CONSTANTS, knowledge_with(belief_in(0.0, 0.3), nozzle_wear(0.0)), learner)
    outcome = learner.learn(event(0.3, seed=1), NO_STANDSTILL, observer.theta.copy())
    assert outcome.adoption is Adoption.ADOPTED
    assert wear_of(outcome.estimate) == pytest.approx(0.3, abs=0.02)
    judge(observer, outcome.forward, outcome)
    np.testing.assert_array_equal(observer.theta, outcome.estimate)
    np.testing.assert_array_equal(outcome.knowledge.in_force, outcome.estimate)
    assert int(observer.memory[0]["judgement"]["phi_version"]) == 4


@pytest.mark.parametrize(
    "damage",
    [lambda p_l: np.where(np.arange(p_l.size) == 300, np.nan, p_l), lambda p_l: np.full(p_l.size, np.inf)],
    ids=["one sample no number", "infinite"],
)
def test_event_that_cannot_be_learned_from_changes_nothing(damage: Callable[[Vector], Vector]) -> None:
    learner = learner_with(belief_in(0.1, 0.3), nozzle_wear(0.1))
    broken = event(0.3, seed=1)
    outcome = learner.learn(broken._replace(output=damage(broken.output)), NO_STANDSTILL, nozzle_wear(0.1))
    assert outcome.adoption is Adoption.FAILED
    np.testing.assert_array_equal(outcome.knowledge.in_force, nozzle_wear(0.1))
    np.testing.assert_array_equal(outcome.estimate, nozzle_wear(0.1))
    np.testing.assert_array_equal(outcome.knowledge.state.learned.belief.mean, nozzle_wear(0.1))
    # and the next event is learned from as if it had not been
    after = learner.learn(event(0.3, seed=2), NO_STANDSTILL, nozzle_wear(0.1))
    assert after.adoption is Adoption.ADOPTED
    assert wear_of(after.estimate) == pytest.approx(0.3, abs=0.02)


def as_text(state: LearningState) -> str:
    return json.dumps(to_plain(state), default=np.ndarray.tolist)


def test_one_that_takes_over_learns_as_the_one_before() -> None:
    """From what a file keeps of it: theta, belief, and what it follows from event to event, to the bit."""
    theta = nozzle_wear(0.0)
    before = learner_with(belief_in(0.0, 0.3), theta)
    outcome = None
    for seed in range(4):
        spiky = event(0.3, seed=seed)
        spiky.output[400 + 20 * seed] += 0.02
        outcome = before.learn(spiky, NO_STANDSTILL, theta)
        theta = outcome.knowledge.in_force
    assert outcome is not None
    remembered = as_text(outcome.knowledge.state)
    after = Learner(CONSTANTS, replace(outcome.knowledge, state=from_plain(LearningState, json.loads(remembered))))
    assert as_text(after.state) == as_text(before.state) == remembered
    first, second = (one.learn(event(0.3, seed=9), NO_STANDSTILL, theta) for one in (before, after))
    np.testing.assert_array_equal(first.estimate, second.estimate)
    assert as_text(first.knowledge.state) == as_text(second.knowledge.state)


def test_an_event_changes_no_state_that_somebody_holds() -> None:
    """So that one that failed half way leaves the state before."""
    learner = learner_with(belief_in(0.0, 0.3), nozzle_wear(0.0))
    for seed in range(3):
        state, before = learner.state, as_text(learner.state)
        learner.learn(event(0.3, seed=seed), NO_STANDSTILL, nozzle_wear(0.0))
        assert as_text(state) == before != as_text(learner.state)


def test_what_was_remembered_at_another_sample_rate_is_not_taken_over() -> None:
    before = learner_with(belief_in(0.0, 0.3), nozzle_wear(0.0))
    knowledge = before.learn(event(0.3, seed=1), NO_STANDSTILL, nozzle_wear(0.0)).knowledge
    constants = constants_for(NOMINAL, 50e3, Durations(), events_required=2)
    fresh = replace(knowledge, state=replace(knowledge.state, interval=0.0))
    assert as_text(Learner(constants, knowledge).state) == as_text(Learner(constants, fresh).state)
    assert as_text(Learner(constants, knowledge).state) != as_text(knowledge.state)
