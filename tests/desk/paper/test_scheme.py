"""The paper's scheme on one injection: what its parts do alone, and what it comes to."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.desk.paper import scheme
from observer_rt.model.effective import coefficients
from tests.desk.paper.conftest import Injection, make_injection

C = coefficients(load_injector())


def squared_error(injection: Injection, weights: NDArray[np.float64], gain: float = 1e5) -> float:
    """MSE of x3 (28) with weights p (48,)."""
    setting = injection.setting(gain)
    seen = scheme.swept(injection.window, setting, scheme.free_network(weights, setting.gain))
    return float(np.mean((seen.x - injection.x)[injection.scored, 2] ** 2))


def trained(injection: Injection, trainings: int = 1, gain: float = 1e5) -> NDArray[np.float64]:
    """Weights p (48,) after so many trainings, each in force for the next."""
    in_force, start = scheme.no_fault(), scheme.scaled_identity(scheme.BETA)
    for _ in range(trainings):
        in_force = start = scheme.train(injection.window, injection.setting(gain), in_force, start)
    return in_force


def test_phi_and_rate_are_the_formulas(worn: Injection) -> None:
    """phi = unit (W tanh(V z) + b), written with matrices, and the balance of (27)."""
    p = 0.1 * np.random.default_rng(7).normal(size=48)
    hidden, output, bias = p[:30].reshape(5, 6), p[30:45].reshape(3, 5), p[45:]
    seen = scheme.swept(worn.window, worn.setting(), scheme.free_network(p, 50.0))
    x, u = seen.x[seen.driven], np.maximum(worn.window.inputs[seen.driven], 0.0)
    z = np.column_stack([x, u, np.ones(len(x))])
    phi = 50.0 * (np.tanh(z @ hidden.T) @ output.T + bias)
    np.testing.assert_allclose(seen.phi[seen.driven], phi, rtol=1e-10, atol=1e-10)
    # (Q_0/a_1)(a_2 root(x_3) - phi_1) of the nominal injector: 69.5 mm3/ms at p_0, 56.25 mm3 for each of phi_1
    rate = 69.53e-6 * x[:, 2] / (x[:, 2] ** 2 + 0.005**2) ** 0.25 - 56.25e-9 * phi[:, 0]
    np.testing.assert_allclose(seen.rate[seen.driven], rate, atol=0.02e-6)
    assert not seen.phi[~seen.driven].any()
    assert not seen.rate[~seen.driven].any()


def test_scaled_identity_of_matrices_that_are_not_square() -> None:
    network = scheme.free_network(scheme.scaled_identity(0.1), 1.0)
    assert network.hidden.shape == (5, 6)
    assert network.output.shape == (3, 5)
    np.testing.assert_array_equal(np.argwhere(network.hidden), [[i, i] for i in range(5)])
    np.testing.assert_array_equal(np.argwhere(network.output), [[i, i] for i in range(3)])
    assert set(network.hidden[network.hidden != 0]) == set(network.bias) == {0.1}


def test_cost_is_half_the_sum_of_squares_in_units_of_the_network() -> None:
    target = np.array([[3.0, 0.0, -4.0], [0.0, 6.0, 0.0]])
    z = np.column_stack([np.zeros((2, 5)), np.ones(2)])
    cost = scheme.FaultCost(z, target, 2.0)
    assert cost.value(scheme.no_fault()) == pytest.approx(0.5 * (9 + 16 + 36) / 4)


def test_error_is_given_to_line_and_sac_in_the_ratio_of_the_paper() -> None:
    np.testing.assert_allclose(scheme.design_vector(C), [1, 0, 12], rtol=1e-3)


@pytest.mark.slow
def test_training_is_thirty_epochs_downhill(worn: Injection) -> None:
    start, setting = scheme.scaled_identity(scheme.BETA), worn.setting()
    seen = scheme.swept(worn.window, setting, scheme.free_network(scheme.no_fault(), setting.gain))
    cost = scheme.FaultCost(*scheme.training_data(worn.window, seen, setting), setting.gain)
    end = scheme.minimise(cost, start, np.eye(start.size), 30)
    assert end.iterations == 30
    assert end.value < 0.01 * cost.value(start)
    np.testing.assert_array_equal(end.theta, scheme.train(worn.window, setting, scheme.no_fault(), start))


@pytest.mark.parametrize("nozzle_wear", [-0.5, -0.2, 0.2, 0.5])
def test_one_training_improves_x_3_two_to_three_times(nozzle_wear: float) -> None:
    """As the paper shows in its Fig. 5: better at every v_H, far from perfect."""
    injection = make_injection(nozzle_wear)
    ratio = squared_error(injection, scheme.no_fault()) / squared_error(injection, trained(injection))
    assert 1.8 < ratio < 3.2


def test_more_gain_identifies_more(worn: Injection) -> None:
    """The target is the fault through a high pass whose corner falls with the gain."""
    errors = [squared_error(worn, trained(worn, gain=gain), gain) for gain in (1e4, 1e5)]
    assert errors[1] < 0.7 * errors[0] < 0.7 * squared_error(worn, scheme.no_fault())


def test_trained_on_it_stays_wrong(worn: Injection) -> None:
    """Ten trainings: the mass stays several per cent off."""
    setting = worn.setting()
    rate = scheme.swept(worn.window, setting, scheme.free_network(trained(worn, 10), setting.gain)).rate
    assert -0.12 < rate[worn.scored].sum() / worn.rate[worn.scored].sum() - 1.0 < -0.03
