"""Misprints of the paper, shown by numbers: (5), and (12) against (13)."""

import numpy as np
import pytest

from observer_rt.core.model.model import rates_of_change
from observer_rt.desk.paper.scheme import FaultCost, free_network, no_fault, scaled_identity, swept
from observer_rt.foundation.units import Floats
from observer_rt.model.network import constant_network
from tests.desk.paper.conftest import GAIN, SAMPLE_RATE, Injection
from tests.differences import differences


def identification_error(injection: Injection, gain: float) -> Floats:
    """|y - C x~| along an injection for the gain of (5); a negative one is the printed minus."""
    setting = injection.setting()._replace(gain=gain, substeps=10)
    window = injection.window
    start = window.start.copy()
    start[0] += 0.01  # 1 MPa off
    seen = swept(window._replace(start=start), setting, free_network(no_fault(), setting.gain))
    return np.abs(seen.error)


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1e4, 3e4, 1e5])
def test_minus_of_equation_5_diverges_and_plus_converges(healthy: Injection, gain: float) -> None:
    plus, minus = identification_error(healthy, gain), identification_error(healthy, -gain)
    assert plus[-100:].max() < 1e-4  # of p_0: the initial error is forgotten
    within = round(10 * SAMPLE_RATE / gain)  # ten time constants
    assert np.nanmax(minus[:within]) > 10 * minus[0]
    assert not (minus[-100:] < 1.0).any()  # p_0 and more, or no number at all


def derivative(values: Floats) -> Floats:
    """Time derivative [1/s], central differences."""
    return np.asarray(np.gradient(values, 1 / SAMPLE_RATE), np.float64)


def model_rates(x: Floats, u: Floats, injection: Injection) -> Floats:
    nothing = constant_network()
    return np.array(
        [rates_of_change((a[0], a[1], a[2]), (b[0], b[1]), injection.c, nothing) for a, b in zip(x, u, strict=True)]
    )


def test_target_without_derivative_is_the_fault_as_the_identification_sees_it(worn: Injection) -> None:
    """e~' + l e~ = Phi + C f(x) - C f(x~) exactly; l e~ leaves out only a derivative."""
    inputs, span = worn.window.inputs, worn.scored
    setting = worn.setting()  # with the opening beyond the end, x^ is x~ of (5) throughout
    shut = worn.window._replace(resting=np.zeros_like(worn.window.resting), opening=worn.window.output.size)
    x_tilde = swept(shut, setting, free_network(no_fault(), setting.gain)).x
    error = worn.window.output - x_tilde[:, 0]
    seen = derivative(error) + GAIN * error
    difference = model_rates(worn.x, inputs, worn)[:, 0] - model_rates(x_tilde, inputs, worn)[:, 0]
    exact = worn.fault[:, 0] + difference
    largest = np.abs(worn.fault[:, 0]).max()
    assert np.sqrt(np.mean((seen - exact)[span] ** 2)) < 0.02 * largest
    assert np.sqrt(np.mean((GAIN * error - exact)[span] ** 2)) < 0.05 * largest


def test_gradient_orders_w_by_rows(worn: Injection) -> None:
    """Finite differences in the order of (13), W by rows, agree; in that of (12), W by columns, they do not."""
    random = np.random.default_rng(4)
    z, target = random.normal(size=(40, 6)), random.normal(size=(40, 3))
    z[:, 5] = 1.0  # z = [x u 1]
    unit = 2.0
    cost = FaultCost(z, target * unit, unit)
    p = scaled_identity(0.3) + 0.2 * random.normal(size=48)

    def printed_13(p: Floats) -> Floats:
        """(13) as printed, with W and V taken from p as this package orders it."""
        network = free_network(p, unit)
        sigma = 2 / (1 + np.exp(-2 * z @ network.hidden.T)) - 1
        error = target - sigma @ network.output.T - network.bias
        slope = (sigma + 1) ** 2 / np.exp(2 * z @ network.hidden.T)
        hidden = -((error @ network.output) * slope).T @ z
        rows = [-(error[:, i] @ sigma) for i in range(3)]
        return np.concatenate([hidden.ravel(), *rows, -error.sum(axis=0)])

    by_rows = differences(cost.value, p, 1e-6)
    by_columns = by_rows.copy()  # as (12) arranges p
    by_columns[30:45] = by_rows[30:45].reshape(3, 5).T.ravel()
    np.testing.assert_allclose(printed_13(p), by_rows, atol=1e-6)
    assert np.abs(printed_13(p) - by_columns).max() > 1.0
    cost.value(p)
    np.testing.assert_allclose(cost.gradient(p), by_rows, atol=1e-6)
