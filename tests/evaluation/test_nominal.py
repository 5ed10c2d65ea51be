"""What the nominal model says beside an observer that learns: what an observer that learns nothing says."""

import numpy as np
import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench, load_injector
from observer_rt.evaluation.evaluate import Evaluation, evaluate
from observer_rt.model.effects import sized
from observer_rt.recording.signals.recording import Recording
from observer_rt.simulation.schedule import Shot, make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, simulate


@pytest.fixture(scope="module")
def worn() -> Recording:
    """Pilot and main injections, the second before the line is at rest."""
    schedule = make_schedule([100e6, 60e6], 5, 0.05, shots=(Shot(0.3e-3, -1.5e-3), Shot(1.0e-3)))
    effects = (sized("orifice_area", v_H=0.2),)
    return simulate(load_injector(), schedule, 50e3, effects, SimulatedNoise(), seed=2).recording


def evaluated(recording: Recording, learning: bool) -> Evaluation:
    return evaluate(load_bench(EXAMPLE_BENCH), [recording], learning=learning).evaluations[0]


def test_as_long_as_nothing_is_learned_it_is_the_observer(worn: Recording) -> None:
    trace = evaluated(worn, learning=False).trace
    np.testing.assert_array_equal(trace.nominal_rate, trace.injection_rate)


def test_once_something_is_learned_it_stays_nominal(worn: Recording) -> None:
    learned, nominal = evaluated(worn, learning=True), evaluated(worn, learning=False)
    rate, expected = learned.trace.nominal_rate, nominal.trace.injection_rate
    known = ~np.isnan(rate) & ~np.isnan(expected)
    peak = expected[known].max()
    assert known.mean() > 0.9
    assert np.abs(rate - expected)[known].max() < 0.02 * peak
    for mine, theirs in zip(learned.injections, nominal.injections, strict=True):
        assert mine.nominal_mass == pytest.approx(theirs.report.mass, rel=0.005)
    assert learned.injections[-1].report.mass > 1.1 * learned.injections[-1].nominal_mass
