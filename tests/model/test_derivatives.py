"""The derivatives beside the laws against differences of the laws, over the whole domain."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import normalised_area, seat_area_slope
from observer_rt.core.model.model import REACH, rates_of_change, slopes_of_flows
from observer_rt.engine.estimation.parameters import PARAMETERS, Parameter, by_theta, learned_of
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.line import LumpLine
from observer_rt.model.parameters import LineOutflow
from observer_rt.model.tangent import tangent_of
from tests.model.conftest import State, filled
from tests.plants.arrays import Array

FULL_LIFT = 1.39  # u_2
STEP = 1e-6
AREA = st.one_of(st.just(0.0), st.floats(1e-3, FULL_LIFT), st.just(FULL_LIFT))
PRESSURE = st.one_of(st.floats(-0.5, 2.0), st.floats(-0.005, 0.005))


@st.composite
def models(draw: st.DrawFn) -> Coefficients:
    """Either outflow form with any effects that change a law."""
    form = draw(st.sampled_from(list(LineOutflow)))
    sizes = {
        "orifice_cavitation": ("n_crit_excess", st.floats(0.0, 0.6)),
        "guide_leakage": ("c", st.floats(0.0, 5e-14)),
        "pressure_dependent_bulk_modulus": ("n", st.floats(-8.0, 12.0)),
        "entrained_air": ("g", st.floats(1e-5, 0.03)),
    }
    effects = [sized(name, **{key: draw(values)}) for name, (key, values) in sizes.items() if draw(st.booleans())]
    if draw(st.booleans()):
        effects.append(sized("chamber_pressure_rise", dp=draw(st.floats(0.0, 40e6)), s=draw(st.floats(0.0, 1.0))))
    injector = filled(load_injector(), draw(st.sampled_from([None, "en590"])))
    return effective_model(injector.model_copy(update={"line_outflow": form}), effects).coefficients


@st.composite
def thetas(draw: st.DrawFn) -> Array:
    theta = np.array(draw(st.lists(st.floats(-0.2, 0.2), min_size=PARAMETERS, max_size=PARAMETERS)))
    theta[[Parameter.ENTRAINED_AIR, Parameter.BACK_PRESSURE, Parameter.BACK_PRESSURE + 1]] += 0.21
    return theta


STATES = st.tuples(PRESSURE, st.floats(-2.0, 2.0), PRESSURE)
INPUTS = st.tuples(PRESSURE, AREA)


def difference(law: Callable[[float], Sequence[float] | float], at: float = 0.0) -> Array:
    near, far = (np.subtract(law(at + k * STEP), law(at - k * STEP)) for k in (1, 2))
    return np.asarray((8.0 * near - far) / (12.0 * STEP))


def shifted(values: Sequence[float], position: int, step: float) -> tuple[float, ...]:
    return tuple(v + step if i == position else v for i, v in enumerate(values))


def away_from_kinks(x: State, u: tuple[float, float], c: Coefficients, learned: float = 0.0) -> None:
    """Where a law has a corner it has no derivative: the start of cavitation, the limits of the stiffness."""
    rise = c.nozzle.chamber_rise + c.nozzle.chamber_rise_with_seat * u[1] + learned if u[1] > 0.0 else 0.0
    assume(abs((c.nozzle.vapour_margin + rise) - c.nozzle.critical_excess * (x[2] - rise)) > 1e-4)
    assume(abs(x[0] + c.line.chamber_pressure - 0.01) > 1e-4)
    bend = np.polyval([c.line.stiffness_bend, c.line.stiffness_slope, 0.95], x[0] - c.line.stiffness_pressure)
    assume(abs(bend) > 1e-4)
    assume(abs(x[1]) > 1e-4)
    ends = zip((x[2], x[0] - x[2]), (REACH[0], REACH[4]), strict=True)  # of the network's curves
    assume(all(abs(value) > 1e-4 and abs(value - reach) > 1e-4 for value, reach in ends))


@given(st.floats(10e-6, 0.3e-3))
def test_area_of_a_lift(lift: float) -> None:
    c = effective_model(load_injector()).coefficients
    numeric = difference(lambda um: float(normalised_area(lift + um * 1e-4, c.seat))) * 1e4 * c.area_scale
    assert seat_area_slope(normalised_area(lift, c.seat), c.seat) == pytest.approx(float(numeric), rel=1e-6)


@pytest.mark.parametrize("area", [0.0, -1e-3])
def test_a_closed_seat_does_not_open_with_noise(area: float) -> None:
    assert seat_area_slope(area, effective_model(load_injector()).coefficients.seat) == 0.0


@given(models(), STATES, INPUTS, thetas())
def test_lump_by_coefficients(c: Coefficients, x: State, u: tuple[float, float], theta: Array) -> None:
    network = learned_of(theta, c).network
    away_from_kinks(x, u, c)
    tangent = tangent_of(c, by_theta(theta, c), PARAMETERS)
    rates_of_change(np.array(x), u, c, network, tangent)

    def by_coefficient(position: int, d: float) -> Sequence[float]:
        return rates_of_change(np.array(x), u, c._replace(line=LumpLine(*shifted(c.line, position, d))), network)[:2]

    bending = {"air"} if c.line.air == 0.0 else set()  # one-sided: air cannot be negative
    bending |= {"stiffness_pressure", "stiffness_bend", "chamber_pressure"}  # nothing changes them
    bending |= {"outflow", "loss"}  # terms do, theta does not
    for i, name in enumerate(LumpLine._fields):
        if name not in bending:
            numeric = difference(partial(by_coefficient, i))
            np.testing.assert_allclose(tangent.by_coefficient[:2, i], numeric, rtol=1e-5, atol=1e-4)


@given(models(), STATES, INPUTS, thetas())
def test_flows_by_state_and_area(c: Coefficients, x: State, u: tuple[float, float], theta: Array) -> None:
    network = learned_of(theta, c).network
    away_from_kinks(x, u, c, float(network.nozzle @ (1.0, u[1])))
    slopes = slopes_of_flows(np.array(x), u, c, network)

    def flows(x: Sequence[float], u: tuple[float, float]) -> Sequence[float]:
        values = slopes_of_flows(np.array(x), u, c, network)
        return values["q_h"], values["q_s"]

    def by_state(position: int, d: float) -> Sequence[float]:
        return flows(shifted(x, position, d), u)

    for i in range(3):
        numeric = difference(partial(by_state, i))
        np.testing.assert_allclose((slopes["h_x"][i], slopes["s_x"][i]), numeric, rtol=1e-6, atol=1e-6)
    if u[1] > 0.0:  # a seat opens to one side only
        numeric = difference(lambda d: flows(x, (u[0], u[1] + d)))
        np.testing.assert_allclose((slopes["h_area"], slopes["s_area"]), numeric, rtol=1e-6, atol=1e-6)


@given(models(), STATES, INPUTS, thetas())
def test_right_hand_side_by_state_and_theta(c: Coefficients, x: State, u: tuple[float, float], theta: Array) -> None:
    """The whole of df/dx and df/dtheta, through the elements and dc/dtheta."""
    learned = learned_of(theta, c)
    changed, network = learned.coefficients, learned.network
    away_from_kinks(x, u, changed, float(network.nozzle @ (1.0, u[1])))
    assume(changed.line.air > 1e-3)
    tangent = tangent_of(changed, by_theta(theta, c), PARAMETERS)
    value = rates_of_change(np.array(x), u, changed, network, tangent)
    by_state = tangent.by_state[0]
    by_number = tangent.by_flow[0] @ tangent.of_flows[0] + tangent.by_number[0]
    assert value == rates_of_change(np.array(x), u, changed, network)

    def of_state(position: int, d: float) -> Sequence[float]:
        return rates_of_change(np.array(shifted(x, position, d)), u, changed, network)

    def of_theta(position: int, d: float) -> Sequence[float]:
        other = learned_of(theta + d * np.eye(PARAMETERS)[position], c)
        return rates_of_change(np.array(x), u, other.coefficients, other.network)

    for i in range(3):
        if not (i == 2 and x[2] == 0.0 and u[1] == 0.0):  # at rest the sac stays
            np.testing.assert_allclose(by_state[:, i], difference(partial(of_state, i)), rtol=1e-5, atol=1e-2)
    for j in range(PARAMETERS):
        np.testing.assert_allclose(by_number[:, j], difference(partial(of_theta, j)), rtol=1e-5, atol=1e-2)
