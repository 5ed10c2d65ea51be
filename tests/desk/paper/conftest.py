"""Shared by the tests of the paper's scheme: one noise-free injection of a worn nozzle."""

from dataclasses import dataclass

import pytest

from observer_rt.config.bench import load_injector
from observer_rt.desk.paper.scheme import PaperSetting
from observer_rt.desk.paper.study import injection_windows, inputs, learning_window, true_fault, true_states
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import simulate
from observer_rt.engine.estimation.predictor import Window
from observer_rt.foundation.units import Floats
from observer_rt.model.effective import Coefficients, coefficients
from observer_rt.model.effects import sized
from observer_rt.model.stability import substeps_needed

SAMPLE_RATE = 100e3
GAIN = 1e5


@dataclass(frozen=True)
class Injection:
    """An injection at 100 MPa, 1.9 ms, as the paper's pair sees it, and the truth over the same samples (n)."""

    c: Coefficients
    window: Window
    x: Floats
    fault: Floats
    rate: Floats
    scored: slice

    def setting(self, gain: float = GAIN) -> PaperSetting:
        substeps = substeps_needed(load_injector(), SAMPLE_RATE)
        return PaperSetting(1 / SAMPLE_RATE, substeps, self.c, gain)


def make_injection(nozzle_wear: float) -> Injection:
    injector = load_injector()
    c = coefficients(injector)
    schedule = make_schedule([100e6], 1, 0.04, [1.9e-3])
    truth = simulate(injector, schedule, SAMPLE_RATE, (sized("orifice_area", v_H=nozzle_wear),)).truth
    (injection,) = injection_windows(truth.needle_lift, SAMPLE_RATE)
    window, first = learning_window(truth, injection, c, SAMPLE_RATE)
    span = slice(first, first + window.output.size)
    x, u = true_states(truth, c)[span], inputs(truth, c)[span]
    return Injection(
        c,
        window,
        x,
        true_fault(x, u, c, nozzle_wear),
        truth.injection_rate[span],
        slice(injection.first - first, injection.last - first),
    )


@pytest.fixture(scope="session")
def worn() -> Injection:
    """v_H = 0.3, the paper's Fig. 4."""
    return make_injection(0.3)


@pytest.fixture(scope="session")
def healthy() -> Injection:
    """v_H = 0."""
    return make_injection(0.0)
