"""The paper's scheme on one injection: what its parts do alone, and what it comes to."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.core.paper.scheme import fault_of, rate_by_balance
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.paper_scheme.network import (
    fault_cost,
    free_network,
    no_fault,
    scaled_identity,
)
from observer_rt.engine.paper_scheme.systems import (
    check_gain,
    design_vector,
    doubts_about_gain,
    swept,
)
from observer_rt.engine.paper_scheme.training import Weights, first_weights, network_of, output_error, train
from observer_rt.foundation.errors import UserError
from observer_rt.model.effective import coefficients
from tests.engine.paper_scheme.conftest import Injection, make_injection

C = coefficients(load_injector())
NOISE = NoiseLevels(rail_pressure=0.1e6, line_pressure=0.15e6, needle_lift=0.4e-6)


def squared_error(injection: Injection, weights: NDArray[np.float64], gain: float = 1e5) -> float:
    """MSE of x3 (28) with weights p (48,)."""
    setting = injection.setting(gain)
    seen = swept(injection.window, setting, network_of(weights, setting))
    return float(np.mean((seen.x - injection.x)[injection.scored, 2] ** 2))


def mass_error(injection: Injection, weights: NDArray[np.float64]) -> float:
    setting = injection.setting()
    rate = swept(injection.window, setting, network_of(weights, setting)).rate
    return float(rate[injection.scored].sum() / injection.rate[injection.scored].sum()) - 1.0


def trained(injection: Injection, trainings: int = 1, gain: float = 1e5) -> NDArray[np.float64]:
    """Weights p (48,) after so many trainings, each in force for the next."""
    weights = first_weights()
    for _ in range(trainings):
        result = train(injection.window, injection.setting(gain), weights)
        weights = Weights(result.weights, result.weights)
    return weights.in_force


@given(st.integers(0, 10_000), st.floats(0.1, 1e6))
def test_network_is_the_formula(seed: int, unit: float) -> None:
    """phi = unit (W tanh(V z) + b), written with matrices."""
    random = np.random.default_rng(seed)
    p = random.normal(size=48)
    x, u = random.normal(size=3), random.normal(size=2)
    hidden, output, bias = p[:30].reshape(5, 6), p[30:45].reshape(3, 5), p[45:]
    expected = unit * (output @ np.tanh(hidden @ np.array([*x, *u, 1.0])) + bias)
    found = fault_of((x[0], x[1], x[2]), (u[0], u[1]), free_network(p, unit))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * unit)


def test_scaled_identity_of_matrices_that_are_not_square() -> None:
    network = free_network(scaled_identity(0.1), 1.0)
    assert network.hidden.shape == (5, 6)
    assert network.output.shape == (3, 5)
    np.testing.assert_array_equal(np.argwhere(network.hidden), [[i, i] for i in range(5)])
    np.testing.assert_array_equal(np.argwhere(network.output), [[i, i] for i in range(3)])
    assert set(network.hidden[network.hidden != 0]) == set(network.bias) == {0.1}


def test_cost_is_half_the_sum_of_squares_in_units_of_the_network() -> None:
    target = np.array([[3.0, 0.0, -4.0], [0.0, 6.0, 0.0]])
    z = np.column_stack([np.zeros((2, 5)), np.ones(2)])
    cost = fault_cost(z, target, 2.0)
    assert cost.value(no_fault()) == pytest.approx(0.5 * (9 + 16 + 36) / 4)


def test_error_is_given_to_line_and_sac_in_the_ratio_of_the_paper() -> None:
    np.testing.assert_allclose(design_vector(C), [1, 0, 12], rtol=1e-3)


def test_balance_with_the_true_fault_is_the_true_rate(worn: Injection) -> None:
    """What the model lacks at the true x3 is in phi_1 of (27)."""
    found = [rate_by_balance(x[2], 1.0, phi[0], worn.c) for x, phi in zip(worn.x, worn.fault, strict=True)]
    np.testing.assert_allclose(found, worn.rate, atol=1e-9 * worn.rate.max())


def test_observer_without_phi_is_the_model(healthy: Injection) -> None:
    assert squared_error(healthy, no_fault()) < 1e-6
    assert abs(mass_error(healthy, no_fault())) < 1e-3


@pytest.mark.slow
def test_training_is_thirty_epochs_downhill(worn: Injection) -> None:
    result = train(worn.window, worn.setting(), first_weights())
    assert result.epochs == 30
    assert result.cost_after < 0.01 * result.cost_before


@pytest.mark.parametrize("nozzle_wear", [-0.5, -0.2, 0.2, 0.5])
def test_one_training_improves_x_3_two_to_three_times(nozzle_wear: float) -> None:
    """As the paper shows in its Fig. 5: better at every v_H, far from perfect."""
    injection = make_injection(nozzle_wear)
    ratio = squared_error(injection, no_fault()) / squared_error(injection, trained(injection))
    assert 1.8 < ratio < 3.2


def test_more_gain_identifies_more(worn: Injection) -> None:
    """The target is the fault through a high pass whose corner falls with the gain."""
    errors = [squared_error(worn, trained(worn, gain=gain), gain) for gain in (1e4, 1e5)]
    assert errors[1] < 0.7 * errors[0] < 0.7 * squared_error(worn, no_fault())


def test_trained_on_it_stays_wrong(worn: Injection) -> None:
    """Ten trainings: better than no observer, but the mass stays several per cent off."""
    weights = trained(worn, 10)
    assert output_error(worn.window, worn.setting(), weights) < output_error(
        worn.window, worn.setting(), no_fault()
    )
    assert -0.12 < mass_error(worn, weights) < -0.03


@pytest.mark.parametrize(("gain", "problem"), [(8e3, "not above the line"), (2e5, "faster than the samples")])
def test_gains_that_cannot_identify_are_refused(gain: float, problem: str) -> None:
    with pytest.raises(UserError, match=problem) as refused:
        check_gain("here", gain, C, 100e3)
    assert refused.value.place == "here"
    assert refused.value.remedy


def test_gains_between_line_mode_and_sample_rate_are_taken() -> None:
    def is_taken(gain: float) -> bool:
        with contextlib.suppress(UserError):
            check_gain("here", gain, C, 100e3)
            return True
        return False

    lowest, rate = C.line.mode, 1 / (1 / 100e3)
    gains = (0.99 * lowest, 1.01 * lowest, 3e4, rate, 1.01 * rate)
    assert [is_taken(gain) for gain in gains] == [False, True, True, True, False]


@pytest.mark.parametrize(("gain", "doubt"), [(1e4, "derivative"), (5e4, None), (1e5, "noise")])
def test_doubts_about_gains(gain: float, doubt: str | None) -> None:
    found = doubts_about_gain(gain, C, NOISE)
    assert found is None if doubt is None else found is not None and doubt in found
