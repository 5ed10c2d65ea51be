"""The state equations against (19)-(23) in physical units, in every sign."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.core.model.model import phi_and_rate, rates_of_change
from observer_rt.model.effective import coefficients
from observer_rt.model.network import HIDDEN, Network, constant_network, network_with
from observer_rt.model.parameters import InjectorParameters, LineOutflow
from tests.intervals import Interval
from tests.model.conftest import advanced, physical_rates

NO_FAULT = constant_network()
PRESSURE = st.floats(-0.5, 2.5)
FLOW = st.floats(-2, 2)
AREA = st.one_of(st.just(0.0), st.floats(0.0, 1.5))
CHANGE = st.floats(-0.8, 0.8)
STATES = st.tuples(PRESSURE, FLOW, PRESSURE)
INPUTS = st.tuples(PRESSURE, AREA)


@st.composite
def networks(draw: st.DrawFn) -> Network:
    network = network_with(np.array(draw(st.lists(st.floats(-0.2, 0.2), min_size=HIDDEN, max_size=HIDDEN))))
    network.bias[:] = draw(st.tuples(CHANGE, CHANGE))
    network.nozzle[:] = draw(st.tuples(st.floats(0, 0.2), st.floats(0, 0.2)))
    return network


@given(x=STATES, u=INPUTS, v_h=CHANGE, v_s=CHANGE, k_h=st.sampled_from([0.0, -0.1, 0.2]))
def test_equations_are_those_in_physical_units(
    injector: InjectorParameters,
    x: tuple[float, float, float],
    u: tuple[float, float],
    v_h: float,
    v_s: float,
    k_h: float,
) -> None:
    nozzle = injector.nozzle.model_copy(update={"coefficient_by_pressure": k_h})
    injector = injector.model_copy(update={"nozzle": nozzle})
    c = coefficients(injector)
    network = constant_network(v_h, v_s)
    rates, q_h = physical_rates(x, u, v_h, v_s, injector)
    np.testing.assert_allclose(rates_of_change(x, u, c, network), rates, rtol=1e-9, atol=1e-6)
    assert phi_and_rate(x, u, c, network)[1] == pytest.approx(q_h, rel=1e-9, abs=1e-15)


@given(x=STATES, u=INPUTS, network=networks())
def test_published_rate_obeys_both_balances_and_phi_is_added(
    injector: InjectorParameters, x: tuple[float, float, float], u: tuple[float, float], network: Network
) -> None:
    """Q_H^ from Q_H,model and the rows of phi, in either outflow form."""
    c = coefficients(injector)
    p_0 = injector.scaling.pressure
    line = injector.line.volume * p_0 / injector.fluid.bulk_modulus_line
    sac = injector.nozzle.sac_volume * p_0 / injector.fluid.bulk_modulus_sac
    phi = phi_and_rate(x, u, c, network)[0]
    added = np.subtract(rates_of_change(x, u, c, network), rates_of_change(x, u, c, NO_FAULT))
    np.testing.assert_allclose(phi, added, rtol=1e-6, atol=1e-6)
    assert phi[1] == 0.0
    expected = phi_and_rate(x, u, c, NO_FAULT)[1] - line * phi[0]
    if injector.line_outflow is LineOutflow.SEAT:
        expected -= sac * phi[2]
    assert phi_and_rate(x, u, c, network)[1] == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_closed_needle_and_empty_sac_are_at_rest(injector: InjectorParameters) -> None:
    c = coefficients(injector)
    worn = constant_network(0.5, 0.5)
    worn.bias[:] = 0.5
    assert rates_of_change((0.95, 0.0, 0.0), (0.95, 0.0), c, worn) == [0.0, 0.0, 0.0]
    assert phi_and_rate((0.95, 0.0, 0.0), (0.95, 0.0), c, worn)[1] == 0.0
    assert phi_and_rate((0.95, 0.3, 0.0), (0.95, 0.0), c, worn) == ((0.0, 0.0, 0.0), 0.0)


def test_sac_of_a_closed_needle_empties_through_the_nozzle(injector: InjectorParameters) -> None:
    c = coefficients(injector)
    x = (0.95, 0.0, 0.8)
    sac = [x[2]]
    for _ in range(100):
        x = advanced(x, Interval((0.95, 0.0), (0.95, 0.0), 1e-5, 4), c, NO_FAULT)
        sac.append(x[2])
    assert all(later < earlier or later == earlier == 0.0 for earlier, later in pairwise(sac))
    assert sac[10] > 0.0
    assert sac[-1] == 0.0  # exactly: then nothing needs fine steps any more
    if injector.line_outflow is LineOutflow.SEAT:
        assert x[:2] == pytest.approx((0.95, 0.0), abs=1e-12)  # shut off from the line
    else:
        assert x[0] < 0.95 - 1e-3  # the paper's line is drained by the nozzle even so


def test_nothing_leaves_an_open_nozzle_against_its_own_pressure(injector: InjectorParameters) -> None:
    """Back-pressure of 8 MPa at a seat open by half: 5 MPa from the start, 3 MPa that come with the seat."""
    c = coefficients(injector)
    network = NO_FAULT._replace(nozzle=np.array([0.05, 0.06]))
    assert phi_and_rate((0.95, 0.3, 0.08), (0.95, 0.5), c, network)[1] == pytest.approx(0.0, abs=1e-15)
    raised, as_before = ((0.95, 0.3, 0.5 + rise) for rise in (0.08, 0.0))
    without_fault = phi_and_rate(as_before, (0.95, 0.5), c, NO_FAULT)[1]
    assert phi_and_rate(raised, (0.95, 0.5), c, network)[1] == pytest.approx(without_fault)
    shut = (0.95, 0.0)
    assert phi_and_rate(as_before, shut, c, network)[1] == phi_and_rate(as_before, shut, c, NO_FAULT)[1]
