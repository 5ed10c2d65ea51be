"""A row more in the table is a scalar more that is learned: the line's inertance, not learned otherwise."""

import numpy as np
import pytest

from observer_rt.core.model.model import advance_state
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import SCALARS, Scalar, Scalars, ShownIndicator
from observer_rt.engine.learning.indicators import indicators_of
from observer_rt.engine.learning.knowledge import Adoption, Outcome, no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.mailbox import judge
from observer_rt.engine.observer import Durations, constants_for, in_force, make_observer
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.model.integrator import Interval
from observer_rt.model.network import zero_network
from tests.engine.sample_stream import NOISE, NOMINAL

INERTANCE = Scalar(
    "inertance",
    SCALARS.width,
    prior=0.3,
    drift=1e-3,
    longest_step=0.2,
    bounds=(-0.6, 1.0),
    gated_from=-0.6,
    shown=ShownIndicator("line_inertance"),
    change=lambda line, i: line._replace(a3=line.a3 * (1.0 + i)),
)
WIDER = Scalars((*SCALARS.rows, INERTANCE))
CONSTANTS = constants_for(NOMINAL, 100e3, Durations(), events_required=2)
SCALE = CONSTANTS.coefficients.pressure_scale
EVENTS = 3


def event(inertance: float, seed: int) -> Window:
    """9 ms at 100 kHz with one stroke, on a line whose a3 is off by `inertance` from the nominal."""
    c = CONSTANTS.coefficients
    c = c._replace(line=c.line._replace(a3=c.line.a3 * (1.0 + inertance)))
    time = np.arange(900) / 100e3
    area = np.interp(time, [1.0e-3, 1.3e-3, 2.1e-3, 2.4e-3], [0.0, 0.9, 0.9, 0.0])
    x = np.array([0.95, 0.0, 0.0])
    line = [x[0]]
    for k in range(time.size - 1):
        u_start, u_end = (0.95, float(area[k])), (0.95, float(area[k + 1]))
        advance_state(x, Interval(u_start, u_end, 1e-5, CONSTANTS.substeps), c, zero_network(), None)
        line.append(x[0])
    output = np.array(line) + np.random.default_rng(seed).normal(0.0, NOISE.line_pressure / SCALE, time.size)
    inputs = np.column_stack([np.full(time.size, 0.95), area])
    return Window(inputs, output, time < 1.0e-3, np.array([0.95, 0.0, 0.0, 0.95]), opening=100)


def learned_from(inertance: float) -> Outcome:
    """What came of the last of a few events, all of them put into force in an observer as wide as the table."""
    knowledge = no_knowledge(NOISE, SCALE, WIDER)
    learner = Learner(CONSTANTS, knowledge, WIDER)
    observer = make_observer(CONSTANTS, knowledge, learner)
    for seed in range(EVENTS):
        outcome = learner.learn(event(inertance, seed), Standstill(0, 0.0, None), in_force(observer))
        judge(observer, outcome.objections, outcome)
    np.testing.assert_array_equal(in_force(observer), outcome.knowledge.in_force)
    line = observer.memory[0]["in_force"]["line"][CONSTANTS.coefficients.line._fields.index("a3")]
    learned = outcome.knowledge.in_force[INERTANCE.column]
    assert line == pytest.approx(CONSTANTS.coefficients.line.a3 * (1.0 + learned), rel=1e-12)
    return outcome


@pytest.mark.parametrize("inertance", [-0.15, 0.15])
def test_another_inertance_is_learned_and_shown(inertance: float) -> None:
    outcome = learned_from(inertance)
    assert outcome.adoption is Adoption.ADOPTED
    shown = indicators_of(
        outcome.estimate, outcome.covariance, np.array([0.9, 1.0, 0.8]), np.array([0.95, 0.9]), WIDER
    )
    assert list(shown)[-1] == "line_inertance"
    assert shown["line_inertance"].value == pytest.approx(inertance, abs=0.02)
    assert shown["line_inertance"].sigma is not None
    assert 0.0 < shown["line_inertance"].sigma < 0.02


def test_inertance_of_a_healthy_line_does_not_pay() -> None:
    assert learned_from(0.0).estimate[INERTANCE.column] == 0.0
