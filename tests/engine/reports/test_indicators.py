"""Wear as a number, whatever the structure that holds it."""

import numpy as np
import pytest

from observer_rt.core.model.model import phi_and_rate
from observer_rt.engine.estimation.parameters import NOZZLE, PARAMETERS, SEAT, WEIGHTS, Parameter, network_of
from observer_rt.engine.learning.mass import OPENED_SINCE, flow_change, nozzle_change
from observer_rt.engine.reports.indicators import LEAST_SEAT_SIGMA, indicators_of
from observer_rt.model.effective import coefficients
from observer_rt.model.network import HIDDEN, constant_network
from tests.differences import differences
from tests.engine.sample_stream import NOMINAL

X, U = (0.9, 1.0, 0.8), (0.95, 0.6)


def worn() -> np.ndarray:
    theta = np.zeros(PARAMETERS)
    theta[Parameter.NOZZLE_BIAS] = 0.2
    theta[WEIGHTS] = np.linspace(-0.01, 0.016, HIDDEN)
    theta[Parameter.BACK_PRESSURE : Parameter.BACK_PRESSURE + 2] = 0.03, 0.05
    return theta


def test_nozzle_change_is_that_of_the_injection_rate() -> None:
    c = coefficients(NOMINAL)
    c = c._replace(nozzle=c.nozzle._replace(transition=1e-9))
    changed = phi_and_rate(X, (*U, OPENED_SINCE), c, network_of(worn()))[1]
    assert nozzle_change(worn(), X, U)[0] == pytest.approx(changed / phi_and_rate(X, U, c, constant_network())[1] - 1)


def test_slopes_are_derivatives() -> None:
    expected = differences(lambda theta: nozzle_change(theta, X, U)[0], worn(), 1e-6)
    assert nozzle_change(worn(), X, U)[1] == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize(("nozzle", "seat"), [(0.2, 0.2), (-0.04, -0.7), (0.3, 0.0), (-0.99, 0.0)])
def test_steady_flow_is_that_through_two_orifices_in_a_row(nozzle: float, seat: float) -> None:
    theta, sac = np.zeros(PARAMETERS), coefficients(NOMINAL).sac
    theta[[Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS]] = nozzle, seat
    before = np.hypot(1.0 / (sac.a5 * U[1]), 1.0 / sac.a6)  # pressures drop as squares of flows, and add up
    after = np.hypot(1.0 / (sac.a5 * U[1] * (1.0 + seat)), 1.0 / (sac.a6 * (1.0 + nozzle)))
    assert flow_change(theta, np.array(U), sac) == pytest.approx(before / after - 1.0)
    assert flow_change(theta, np.array([U[0], 0.0]), sac) == pytest.approx(seat, abs=1e-6)  # it is all at the seat


def test_seat_wear_is_never_told_closer_than_sensors_allow() -> None:
    exact = indicators_of(worn(), np.zeros((PARAMETERS, PARAMETERS)), np.array(X), np.array(U))
    assert exact[SEAT].sigma == pytest.approx(LEAST_SEAT_SIGMA)
    assert exact[NOZZLE].sigma == 0.0


def test_what_is_another_change_at_another_rail_pressure_is_no_wear() -> None:
    exact, x, u = np.zeros((PARAMETERS, PARAMETERS)), np.array(X), np.array(U)
    elsewhere = nozzle_change(worn(), 0.5 * x, np.array([0.5 * U[0], U[1]]))[0]
    nozzle = indicators_of(worn(), exact, x, u, rails=[U[0], 0.5 * U[0]])[NOZZLE]
    assert nozzle.sigma == pytest.approx(abs(elsewhere - nozzle.value))
    steeper = nozzle_change(worn(), 0.5 * x, np.array([0.5 * U[0], U[1]]))[1] - nozzle_change(worn(), x, u)[1]
    for share in (0.9, 1.1):  # of a covariance by which two standard deviations explain it
        explains = np.eye(PARAMETERS) * (share * (elsewhere - nozzle.value) ** 2 / (4.0 * steeper @ steeper))
        here, both = (indicators_of(worn(), explains, x, u, rails=r)[NOZZLE].sigma for r in ([], [0.5 * U[0]]))
        assert (here != both) == (share < 1.0)
    constant = np.zeros(PARAMETERS)
    constant[Parameter.NOZZLE_BIAS] = 0.2
    assert indicators_of(constant, exact, x, u, rails=[0.5])[NOZZLE].sigma == 0.0
