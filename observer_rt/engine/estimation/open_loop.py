"""Observer x^ over an event, open loop: its injection rate with slopes, and its variance by noise of the inputs."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.predictor import follow, propagate_noise
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.predictor import NO_RATE, NO_SLOPES, Setting, Window, gradient_of
from observer_rt.engine.estimation.scalars import Parameter, learned_of


class OpenLoop(NamedTuple):
    """x^ over a window of n samples: it follows x~ up to the opening, and runs open loop from there.

    rate: (n,) Q_H^ [m3/s]; slopes: (n, m) its derivatives with respect to theta; gradient: (n, states + 1)
    with respect to x and A_S [m3/s]; transition: (n, states, states) derivatives of x with respect to x one sample
    before; relaxation: (n,) rate [1/s] at which p_S goes where the needle leads it; by_area: (n,) dp_S/dA_S there,
    normalised by (24); fullness: (n,) p_S over p_L. All 0 where nothing flows.
    """

    rate: NDArray[np.float64]
    slopes: NDArray[np.float64]
    gradient: NDArray[np.float64]
    transition: NDArray[np.float64]
    relaxation: NDArray[np.float64]
    by_area: NDArray[np.float64]
    fullness: NDArray[np.float64]


def open_loop(window: Window, setting: Setting, theta: NDArray[np.float64]) -> OpenLoop:
    """x^ with the parameters theta (m,) over a window, its sensitivities starting at 0 at the opening."""
    n, m, states = window.output.size, theta.size, setting.coefficients.states
    learned = learned_of(theta, setting.coefficients)
    result = OpenLoop(
        rate=np.zeros(n),
        slopes=np.zeros((n, m)),
        gradient=np.zeros((n, states + 1)),
        transition=np.zeros((n, states, states)),
        relaxation=np.zeros(n),
        by_area=np.zeros(n),
        fullness=np.zeros(n),
    )
    gradient = gradient_of(theta, setting.coefficients, states)
    follow(window, setting, learned, window.opening, np.empty(n), NO_RATE, gradient, NO_SLOPES, run=result)
    if setting.rail_share == 0.0:
        return result
    level = level_of(theta, setting)
    for flow in (result.rate, result.slopes, result.gradient):
        flow *= level
    result.slopes[:, Parameter.LINE_PRESSURE_GAIN] += setting.rail_share / level * result.rate
    return result


def level_of(theta: NDArray[np.float64], setting: Setting) -> float:
    """Factor on flows with theta (m,), which are reckoned in the rail sensor's units."""
    return 1.0 + setting.rail_share * float(theta[Parameter.LINE_PRESSURE_GAIN])


@dataclass(frozen=True)
class InputVariance:
    """Variances by input noise alone, both (n,): of the rate [m6/s2], of the volume since the last opening [m6]."""

    rate: NDArray[np.float64]
    volume: NDArray[np.float64]


def input_variance(window: Window, run: OpenLoop, setting: Setting, noise: NoiseLevels) -> InputVariance:
    """Variance by noise of lift and rail pressure, and of x~ at the opening, through `run` over the window."""
    n = window.output.shape[0]
    result = InputVariance(np.zeros(n), np.zeros(n))
    c = setting.coefficients
    line_pressure = noise.line_pressure / c.pressure_scale
    pressure = setting.gain[0] * line_pressure**2
    propagate_noise(
        window.inputs[:, 1],
        window.opening,
        run,
        setting.interval,
        c.seat,
        (pressure, pressure / c.line.impedance**2),
        c.line.by_rail * (setting.interval * noise.rail_pressure / c.pressure_scale),
        noise.needle_lift / c.area_scale,
        result.rate,
        result.volume,
    )
    return result
