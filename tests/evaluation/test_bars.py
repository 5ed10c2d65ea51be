"""The accuracy the observer is judged by, at 50 kHz with noise, over events 4-10 of 10.

Frames on a bus are those of `evaluate`, bit for bit (tests of the daemon), so these figures hold there too.
"""

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.model.effects import sized
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, simulate

SAMPLE_RATE = 50e3
JUDGED = slice(3, 10)
NOMINAL_ERRORS = {0.3: -0.21, -0.3: 0.38, 0.0: 0.0}  # of the model that knows nothing of the wear


@pytest.mark.parametrize("v_h", [0.3, -0.3, 0.0])
def test_mass_and_rate(v_h: float) -> None:
    schedule = make_schedule([100e6], 10, 0.06, [1.9e-3])
    made = simulate(
        load_injector(), schedule, SAMPLE_RATE, (sized("orifice_area", v_H=v_h),), SimulatedNoise(), seed=7
    )
    (found,) = evaluate(load_bench(), [made.recording]).evaluations
    density = load_injector().fluid.density_nozzle
    results = found.injections
    assert len(results) == 10
    assert [result.report.valid for result in results] == [False] * 2 + [True] * 8
    squares = []
    for result in results[JUDGED]:
        window = slice(result.report.start_index, result.report.end_index + 1)
        true_rate = made.truth.injection_rate[window]
        true_mass = np.trapezoid(true_rate) / SAMPLE_RATE * density
        nominal_error = result.nominal_mass / true_mass - 1
        assert nominal_error == pytest.approx(NOMINAL_ERRORS[v_h], abs=0.02)
        if v_h == 0.0:
            assert result.report.mass == pytest.approx(result.nominal_mass, rel=0.005)
        assert result.report.mass == pytest.approx(true_mass, rel=0.01)
        squares.append(np.mean((found.trace.injection_rate[window] - true_rate) ** 2))
    assert np.sqrt(np.mean(squares)) / 1e-6 <= 1.0
