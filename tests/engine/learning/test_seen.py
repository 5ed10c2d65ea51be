"""Laws in force are believed where recordings showed them, and no further."""

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.errors import UserError
from observer_rt.model.terms.in_force import TermInForce
from observer_rt.model.terms.term import TermEquation

LAW = TermInForce(
    equation=TermEquation.NOZZLE_FLOW, law="0.001 * (line_pressure - 80)", seen={"line_pressure": (30.0, 100.0)}
)


def test_an_event_beyond_the_seen_range_of_a_law_is_no_mass_to_rely_on() -> None:
    bench = load_bench().exact.with_parameters(load_injector().model_copy(update={"terms": (LAW,)}))
    for pressure, is_beyond in ((60e6, False), (140e6, True)):
        shots = make_schedule([pressure], 5, 0.06, [1.9e-3])
        recording = simulate(load_injector(), shots, 100e3, (), SimulatedNoise(), seed=3).recording
        reports = evaluate(bench, [recording]).evaluations[0].reports[2:]  # of the first two nothing is known yet
        assert [Reason.OUTSIDE_LEARNED_RANGE in one.reasons for one in reports] == [is_beyond] * 3


def test_beyond_its_seen_range_a_law_stays_what_it_is_at_the_end() -> None:
    pressures = np.array([0.0, 30.0, 60.0, 100.0, 250.0])
    values = LAW.term.law.at({"line_pressure": pressures})
    np.testing.assert_allclose(values, [-0.05, -0.05, -0.02, 0.02, 0.02])


@pytest.mark.parametrize("seen", [{"line_presure": (0.0, 1.0)}, {"line_pressure": (2.0, 1.0)}])
def test_a_seen_range_of_nothing_is_refused(seen: dict[str, tuple[float, float]]) -> None:
    with pytest.raises(UserError, match="no range of a variable"):
        _ = LAW.model_copy(update={"seen": seen}).term
