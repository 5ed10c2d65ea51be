"""The line in which pressure travels: its derivatives, what it conserves, and what it comes to in fine steps."""

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.estimation.learned import by_theta, learned_of
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.coefficients import Coefficients, averaged
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.integrator import Interval, advance_over
from observer_rt.model.line.interface import rest_line
from observer_rt.model.network import constant_network
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.right_hand_side import injection_rate, tangent_of
from observer_rt.model.stability import substeps_needed

RATE = 1e5  # Hz
RAIL = 0.95  # normalised
LIFTED = ([0.3e-3, 0.5e-3, 1.1e-3, 1.3e-3], [0.0, 1.39, 1.39, 0.0])  # a seat area over time
NO_KNOT = (0.0, 0.0)


def injector(sac_volume: float | None = None, outflow: str = "seat", **line: Any) -> InjectorParameters:
    nominal = load_injector()
    sac = {} if sac_volume is None else {"sac_volume": sac_volume}
    return nominal.model_copy(
        update={
            "line_outflow": outflow,
            "line": nominal.line.model_copy(update={"model": "wave"} | line),
            "nozzle": nominal.nozzle.model_copy(update=sac),
        }
    )


def area(time: float) -> float:
    return float(np.interp(time, *LIFTED))


def run(
    c: Coefficients, rate: float, substeps: int, seconds: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States and injection rates [m3/s] at the samples of an injection."""
    x = np.zeros(c.states)
    rest_line(x, RAIL, c.line)
    network = constant_network()
    states, rates = [x.copy()], [0.0]
    for k in range(round(seconds * rate)):
        u = (RAIL, area(k / rate)), (RAIL, area((k + 1) / rate))
        advance_over(x, Interval(*u, 1.0 / rate, substeps), NO_KNOT, c, network, None)
        states.append(x.copy())
        rates.append(injection_rate(x, u[1], c, network))
    return np.array(states), np.array(rates)


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 2**31),
    st.sampled_from(["shut", "opening", "open", "closing", "knot"]),
    st.sampled_from([75e-9, 2e-9]),
    st.sampled_from(["seat", "nozzle"]),
    st.sampled_from([1e5, 2e4]),
    st.booleans(),
)
def test_derivatives(
    seed: int, needle: str, sac_volume: float, outflow: str, rate: float, means: bool
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
    )
    c = effective_model(parameters, effects).coefficients
    c = averaged(c) if means else c
    theta = random.uniform(-0.1, 0.1, PARAMETERS)
    theta[[Parameter.GUIDE_LEAKAGE, Parameter.ENTRAINED_AIR, Parameter.BACK_PRESSURE]] = 0.02
    start = np.zeros(c.states)
    rest_line(start, 1.0, c.line)
    start += random.uniform(-0.1, 0.1, c.states)
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

    def stepped(theta: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
        learned = learned_of(theta, c)
        after = x.copy()
        advance_over(after, interval, knot, learned.coefficients, learned.network, None)
        return after

    learned = learned_of(theta, c)
    tangent = tangent_of(c, learned.network, by_theta(theta, c), PARAMETERS + c.states)
    tangent.by[:, PARAMETERS:] = np.eye(c.states)
    x = start.copy()
    advance_over(x, interval, knot, learned.coefficients, learned.network, tangent)
    np.testing.assert_array_equal(x, stepped(theta, start))
    for j, d in enumerate(np.eye(PARAMETERS) * 1e-5):
        numeric = (stepped(theta + d, start) - stepped(theta - d, start)) / 2e-5
        np.testing.assert_allclose(
            tangent.by[:, j],
            numeric,
            rtol=1e-4,
            atol=2e-5,
            err_msg=f"theta {j}",
        )
    for j, d in enumerate(np.eye(c.states) * 1e-5):
        if j == 2 and start[2] == 0.0:
            continue  # an empty sac behind a shut needle is a corner
        numeric = (stepped(theta, start + d) - stepped(theta, start - d)) / 2e-5
        np.testing.assert_allclose(
            tangent.by[:, PARAMETERS + j], numeric, rtol=1e-4, atol=2e-5, err_msg=f"x{j}"
        )
