"""phi with its rows tied 1 : 0 : L_3 and no structure: L (w tanh(V z) + b), carried by x~ and x^, compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window, correct
from observer_rt.model.sensor import lagged
from observer_rt.observer.paper_scheme.network import FreeNetwork, free_fault
from observer_rt.observer.paper_scheme.systems import PaperSetting, balanced_rate, observe


class Correction(NamedTuple):
    """Gain (3,) of x~, and of the sensor the offset [p_0] and the lag [s]."""

    gain: NDArray[np.float64]
    offset: float
    lag: float


@njit(cache=True, nogil=True)
def sweep(
    window: Window,
    setting: PaperSetting,
    correction: Correction,
    network: FreeNetwork,
    corrected: int,
    innovations: NDArray[np.float64],
    rate: NDArray[np.float64],
) -> None:
    """Innovations (n,) of x~ [p_0] and injection rate (n,) [m3/s]; from sample `corrected` on it runs open loop.

    Nothing holds phi at 0 while the needle is shut; only when it has long been is the sac at rest and the rate 0.
    """
    x = (window.start[0], window.start[1], window.start[2])
    indicated = window.start[3]
    innovations[0] = 0.0
    rate[0] = 0.0
    for k in range(1, window.output.shape[0]):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u_end = (window.inputs[k, 0], window.inputs[k, 1])
        before = x[0]
        x = observe(x, u_start, u_end, setting, network)
        indicated = lagged(indicated, before, x[0], setting.interval, correction.lag)
        innovation = window.output[k] - correction.offset - indicated
        innovations[k] = innovation
        if k < corrected:
            x = correct(x, innovation, correction.gain[0], correction.gain[1])
            indicated += correction.gain[2] * innovation
        rate[k] = 0.0
        if window.resting[k]:
            x = (x[0], x[1], 0.0)
        else:
            phi = free_fault(x, (u_end[0], max(u_end[1], 0.0)), network)
            rate[k] = balanced_rate(x[2], u_end[1], phi[0], setting.coefficients)
