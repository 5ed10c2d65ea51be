"""The line in which pressure travels: its derivatives, what it conserves, and what it comes to in fine steps."""

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.core.model.model import FORGETTING, WEIGHTS, advance_state, phi_and_rate, slopes_of_flows
from observer_rt.engine.estimation.parameters import PARAMETERS, Parameter, by_theta, learned_of
from observer_rt.model.effective import Coefficients, averaged
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.network import constant_network
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import substeps_needed
from observer_rt.model.tangent import tangent_of
from observer_rt.model.wave_line import pressure_at
from tests.intervals import Interval
from tests.model.conftest import at_rest, filled, with_line
from tests.plants.arrays import Array

RATE = 1e5  # Hz
RAIL = 0.95  # normalised
LIFTED = ([0.3e-3, 0.5e-3, 1.1e-3, 1.3e-3], [0.0, 1.39, 1.39, 0.0])  # a seat area over time
NO_KNOT = (0.0, 0.0)


def injector(sac_volume: float | None = None, outflow: str = "seat", **line: Any) -> InjectorParameters:
    nominal = with_line(load_injector(), **({"model": "wave"} | line))
    sac = {} if sac_volume is None else {"sac_volume": sac_volume}
    return nominal.model_copy(update={"line_outflow": outflow, "nozzle": nominal.nozzle.model_copy(update=sac)})


def area(time: float) -> float:
    return float(np.interp(time, *LIFTED))


def run(c: Coefficients, rate: float, substeps: int, seconds: float) -> tuple[Array, Array]:
    x, network = at_rest(c), constant_network()
    states, rates = [x.copy()], [0.0]
    for k in range(round(seconds * rate)):
        u = (RAIL, area(k / rate)), (RAIL, area((k + 1) / rate))
        advance_state(x, Interval(*u, 1.0 / rate, substeps), c, network)
        states.append(x.copy())
        rates.append(phi_and_rate(x, u[1], c, network)[1])
    return np.array(states), np.array(rates)


def assert_between(slope: Array, above: Array, below: Array, name: str) -> None:
    """A slope is that of both sides, to 1e-4; where they differ more, a corner lies between (friction at no flow)."""
    nearest = np.clip(slope, np.minimum(above, below), np.maximum(above, below))
    np.testing.assert_allclose(slope, nearest, rtol=1e-4, atol=2e-5, err_msg=name)


@pytest.mark.slow
@example(35345, "shut", 75e-9, "seat", 1e5, False, 0.1)
@example(83103411, "knot", 2e-9, "seat", 2e4, True, 0.1)  # the nozzle's flow falls with its pressure
@given(
    st.integers(0, 2**31),
    st.sampled_from(["shut", "opening", "open", "closing", "knot"]),
    st.sampled_from([75e-9, 2e-9]),
    st.sampled_from(["seat", "nozzle"]),
    st.sampled_from([1e5, 2e4]),
    st.booleans(),
    st.just(0.05),  # a network of larger weights may turn a flow round
)
def test_derivatives(
    seed: int, needle: str, sac_volume: float, outflow: str, rate: float, means: bool, width: float
) -> None:
    """Of an interval's step by theta and by the state before it, against differences of the step itself."""
    random = np.random.default_rng(seed)
    effects = [
        sized("guide_leakage", c=2e-14),
        sized("pressure_dependent_bulk_modulus", n=8.0),
        sized("entrained_air", g=0.02),
    ]
    parameters = injector(
        sac_volume,
        outflow,
        model="wave_two_part",
        cells=4,
        impedance_ratio=1.5,
        impedance_step=0.33,
        end_volume=3e-8,
        inlet_loss_factor=20.0,
        wall_viscosity=6e-6,
    )
    parameters = filled(parameters, None if seed % 2 else "en590")
    c = effective_model(parameters, effects).coefficients
    c = averaged(c) if means else c
    theta = random.uniform(-width, width, PARAMETERS)
    theta[[Parameter.GUIDE_LEAKAGE, Parameter.ENTRAINED_AIR, Parameter.BACK_PRESSURE]] = 0.02
    start = at_rest(c, 1.0) + random.uniform(-0.1, 0.1, c.states)
    start[2] = 0.0 if needle in ("shut", "opening") else random.uniform(0.3, 0.8)
    first, last = {
        "shut": (0.0, 0.0),
        "opening": (-0.1, 0.2),
        "open": (1.0, 1.2),
        "closing": (0.2, 0.0),
        "knot": (0.3, 0.1),
    }[needle]
    knot = (0.4, -0.05) if needle == "knot" else NO_KNOT
    interval = Interval((0.95, first), (0.96, last), 1.0 / rate, substeps_needed(parameters, rate))

    def stepped(theta: Array, x: Array) -> Array:
        learned = learned_of(theta, c)
        after = x.copy()
        advance_state(after, interval, learned.coefficients, learned.network, knot=knot)
        return after

    learned = learned_of(theta, c)
    tangent = tangent_of(c, by_theta(theta, c), PARAMETERS + c.states)
    tangent.by[:, PARAMETERS : PARAMETERS + c.states] = np.eye(c.states)
    x = start.copy()
    advance_state(x, interval, learned.coefficients, learned.network, tangent, knot)
    np.testing.assert_array_equal(x, stepped(theta, start))
    for j, d in enumerate(np.eye(PARAMETERS) * 1e-5):
        sides = (stepped(theta + d, start) - x) / 1e-5, (x - stepped(theta - d, start)) / 1e-5
        assert_between(tangent.by[:, j], *sides, f"theta {j}")
    for j, d in enumerate(np.eye(c.states) * 1e-5):
        if j == 2 and start[2] == 0.0:
            continue  # an empty sac behind a shut needle is a corner
        sides = (stepped(theta, start + d) - x) / 1e-5, (x - stepped(theta, start - d)) / 1e-5
        assert_between(tangent.by[:, PARAMETERS + j], *sides, f"x{j}")


@pytest.mark.parametrize("rate", [1e5, 2e4])
def test_transition_is_that_of_the_steps(rate: float) -> None:
    """What the gain is computed from, against the steps themselves on small waves behind a shut needle."""
    two_parts: dict[str, Any] = {"model": "wave_two_part", "cells": 6, "impedance_ratio": 0.7, "impedance_step": 0.4}
    parameters = injector(2e-9, **two_parts, wall_viscosity=6e-6)
    c = effective_model(parameters).coefficients
    matrix, by_rail = c.line.transition(1.0 / rate)
    states = [i for i in range(c.states) if i != 2]
    small = 1e-7  # friction is of second order
    interval = Interval((0.0, 0.0), (0.0, 0.0), 1.0 / rate, substeps_needed(parameters, rate))
    for column, state in enumerate(states):
        x = np.zeros(c.states)
        x[state] = small
        advance_state(x, interval, c, constant_network())
        np.testing.assert_allclose(x[states] / small, matrix[:, column], atol=1e-5)
    x = np.zeros(c.states)
    advance_state(x, interval._replace(start=(small, 0.0), end=(small, 0.0)), c, constant_network())
    np.testing.assert_allclose(x[states] / small, by_rail, atol=1e-5)


def test_a_line_at_rest_stays_so() -> None:
    c = effective_model(injector(end_volume=2e-8)).coefficients
    x = at_rest(c)
    before = x.copy()
    for _ in range(100):
        advance_state(x, Interval((RAIL, 0.0), (RAIL, 0.0), 1e-5, 1), c, constant_network())
    np.testing.assert_array_equal(x, before)


def test_what_leaves_the_line_was_in_it() -> None:
    """Without a rail to feed it, the expansion of the line's fuel is injected or fills the sac."""
    c = effective_model(injector(3e-9, end_volume=2e-8)).coefficients
    line = c.line._replace(a3=1e-9 * c.line.a3)  # so heavy that nothing moves along it
    rate = 1e6
    alone = c._replace(line=line)
    x, injected = at_rest(alone), 0.0
    for k in range(900):
        u = (RAIL, area(k / rate)), (RAIL, area((k + 1) / rate))
        before = phi_and_rate(x, u[0], alone, constant_network())[1]
        advance_state(x, Interval(*u, 1.0 / rate, 1), alone, constant_network())
        injected += 0.5 * (before + phi_and_rate(x, u[1], alone, constant_network())[1]) / rate
    cells = int(line.cells)
    pressures = np.array([x[pressure_at(i, cells)] for i in range(1, cells + 1)])
    compliance = np.full(cells, c.flow_scale / line.b)
    compliance[-1] = c.flow_scale / line.a1
    lost = float(np.sum((RAIL - pressures) * compliance))
    sac = x[2] * (c.nozzle.flow / c.sac.a6)
    assert injected + sac == pytest.approx(lost, rel=2e-3)
    assert injected > 2e-9


def test_a_throttle_takes_what_as_much_friction_does_of_a_steady_flow() -> None:
    """And not at once: it stands at the rail."""
    courses, open_wide = [], Interval((RAIL, 1.0), (RAIL, 1.0), 1e-5, 1)
    for loss, inlet in ((18.0, None), (8.0, 10.0)):
        c = effective_model(injector(3e-9, loss_factor=loss, inlet_loss_factor=inlet)).coefficients
        x, course = at_rest(c), []
        for _ in range(5000):
            advance_state(x, open_wide, c, constant_network())
            course.append(x[0])
        courses.append(np.array(course))
    along, throttled = courses
    assert along[-1] == pytest.approx(throttled[-1], abs=1e-6)
    assert RAIL - throttled[-1] > 1e-3
    assert np.max(np.abs(along - throttled)) > 1e-3


def test_the_wall_remembers_as_it_should() -> None:
    """Of a change of flow, 2/sqrt(pi t): the thin boundary layer of Zielke's friction."""
    times = np.geomspace(10e-6, 3e-3, 50)
    weighted = sum(w * np.exp(-s * times) for w, s in zip(WEIGHTS, FORGETTING, strict=True))
    np.testing.assert_allclose(weighted, 2.0 / np.sqrt(np.pi * times), rtol=0.07)


def test_a_tiny_sac_is_where_its_flows_balance() -> None:
    c = effective_model(injector(1e-11)).coefficients
    states, _ = run(c, RATE, 1, 0.9e-3)
    flows = slopes_of_flows(states[-1], (RAIL, area(0.9e-3)), c, constant_network())
    q_h, q_s = flows["q_h"], flows["q_s"]
    assert c.nozzle.flow * q_h == pytest.approx(c.sac.a5 / c.sac.a6 * c.nozzle.flow * q_s, rel=1e-5)


@pytest.mark.parametrize("sac_volume", [75e-9, 3e-9])
def test_ten_cells_are_as_good_as_forty(sac_volume: float) -> None:
    """Against four times the cells in steps of a quarter; corners of the area are cut, and short waves differ."""
    coarse = injector(sac_volume, damping=0.3, end_volume=1e-8)
    steps = substeps_needed(coarse, RATE)
    states, rates = run(effective_model(coarse).coefficients, RATE, steps, 3e-3)
    fine = injector(sac_volume, damping=0.3, end_volume=1e-8, cells=36)
    every = 4
    exact, exact_rates = run(effective_model(fine).coefficients, every * RATE, 1, 3e-3)
    mass, exact_mass = np.sum(rates), np.sum(exact_rates[::every])
    assert mass == pytest.approx(exact_mass, rel=1.5e-3)
    assert np.sqrt(np.mean((states[:, 0] - exact[::every, 0]) ** 2)) < 6e-3  # of p_0; the dip is .15


@pytest.mark.parametrize(("fuel", "pressure"), [(None, 5e6), ("rme", 40e6), ("rme", 160e6), ("rme", 230e6)])
def test_travel_time(fuel: str | None, pressure: float) -> None:
    """A step of the rail pressure reaches the closed end when sound does, and is doubled there."""
    parameters = filled(injector(damping=0.05), fuel)
    c = effective_model(parameters).coefficients
    filling, base = parameters.fluid.in_line.filling, pressure / 1e8 - 0.05
    travel = c.line.cells / c.line.crossing * np.sqrt(filling(100e6) / filling(pressure))
    x, pressures = at_rest(c, base), []
    for _ in range(round(2.0 * travel * RATE)):
        advance_state(x, Interval((base + 0.1, 0.0), (base + 0.1, 0.0), 1e-5, 1), c, constant_network())
        pressures.append(x[0] - base)
    arrived = np.argmax(np.array(pressures) > 0.1) * 1e-5
    assert arrived == pytest.approx(travel, abs=1.5e-5)
    assert np.mean(pressures[-5:]) == pytest.approx(0.2, rel=0.1)
