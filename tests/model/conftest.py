"""Shared by the tests of the model: an injector in both outflow forms, and trajectories over given inputs."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.model.effective import Coefficients
from observer_rt.model.integrator import Interval, advance, advance_over
from observer_rt.model.network import Network, zero_network
from observer_rt.model.parameters import InjectorParameters, LineOutflow

State = tuple[float, float, float]
Trajectory = Callable[..., NDArray[np.float64]]


@pytest.fixture(params=list(LineOutflow), ids=str)
def injector(request: pytest.FixtureRequest) -> InjectorParameters:
    """The nominal injector with the line drained by the nozzle flow, then by the seat flow."""
    return load_injector().model_copy(update={"line_outflow": request.param})


@pytest.fixture
def integrate() -> Trajectory:
    """States (n, 3) at the samples of inputs (n, 2), linear between them, from a start state."""

    def run(
        inputs: NDArray[np.float64],
        start: State,
        interval: float,
        substeps: int,
        c: Coefficients,
        network: Network | None = None,
        zero_order_hold: bool = False,
    ) -> NDArray[np.float64]:
        states = np.empty((len(inputs), c.states))
        states[0] = start
        network = network or zero_network()
        for n in range(len(inputs) - 1):
            u_start = (float(inputs[n, 0]), float(inputs[n, 1]))
            u_end = u_start if zero_order_hold else (float(inputs[n + 1, 0]), float(inputs[n + 1, 1]))
            states[n + 1] = states[n]
            advance(states[n + 1], Interval(u_start, u_end, interval, substeps), c, network, None)
        return states

    return run


def advanced(x: State, interval: Interval, c: Coefficients, network: Network) -> State:
    """`advance` without a tangent, as a function of the state."""
    return advanced_over(x, interval, (0.0, 0.0), c, network)


def advanced_over(
    x: State, interval: Interval, knot: tuple[float, float], c: Coefficients, network: Network
) -> State:
    """`advance_over` likewise."""
    state = np.array(x)
    advance_over(state, interval, knot, c, network, None)
    return float(state[0]), float(state[1]), float(state[2])
