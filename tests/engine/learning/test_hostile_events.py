"""Whatever numbers an event yields, it is refused at worst: no error, and no belief that the next one cannot use."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from observer_rt.engine.estimation.predictor import NoiseLevels, Window
from observer_rt.engine.learning.knowledge import no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.stream.standstill import Standstill
from tests.engine.learning.strokes import CONSTANTS, SCALE, stroke_of
from tests.engine.sample_stream import NOISE


@st.composite
def events(draw: st.DrawFn) -> Window:
    """A stroke whose pressures no injector has."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    window = stroke_of(seed=draw(st.integers(0, 99)))
    line, rail, n = window.output.copy(), window.inputs[:, 0].copy(), window.output.size
    line = draw(st.sampled_from([1.0, 0.0, -1.0, 1.02, 0.9, 3.0])) * line
    line += draw(st.sampled_from([0.0, 0.01, -0.5, 5.0]))
    line += draw(st.sampled_from([0.0, 0.01, 0.15, 1.0])) * rng.standard_normal(n)
    rail += draw(st.sampled_from([0.0, 1.0, -1.0])) * (np.arange(n) > draw(st.integers(0, n)))
    period = draw(st.sampled_from([0.0, 7.0, 40.0]))
    if period:
        line += 0.1 * np.sin(np.arange(n) / period)
    if draw(st.booleans()):
        line = np.full(n, line[0])
    return window._replace(inputs=np.column_stack((rail, window.inputs[:, 1])), output=line)


@given(st.lists(events(), min_size=2, max_size=3))
@settings(max_examples=15, deadline=None)
def test_hostile_events_are_refused_at_worst(hostile: list[Window]) -> None:
    learner = Learner(CONSTANTS, no_knowledge(NOISE, SCALE))
    in_force = np.zeros_like(learner.state.learned.theta)
    still = Standstill(samples=2000, offset=0.0, noise=NoiseLevels(1e5, 1.5e5, 4e-7))
    for window in [*hostile, *[stroke_of(seed=i) for i in range(2)]]:
        outcome = learner.learn(window, still, in_force)
        assert np.isfinite(outcome.knowledge.in_force).all()
        in_force = outcome.knowledge.in_force
        np.linalg.cholesky(learner.state.learned.belief.covariance)
