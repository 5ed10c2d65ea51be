"""The pair of the paper over one event: identification system (5) and observer (26).

Erratum: (5) is printed with a minus, which with y - C x~ is positive feedback. Here

    x~' = f(x~, u) + l C^T (y - C x~)        x^' = f(x^, u) + phi(x^, u)

Erratum: (6) as printed uses x~' where Talebi's form has the derivative of the output error e = y - C x^, and so adds
a pressure rate to a difference of model rates that it does not belong to. Exactly, and without a derivative,

    eps = L (e~' + l e~ - C phi) ~ L l e~ - phi,    e~ = y - C x~,

for which the gradient (13) is exact. L = [1 0 a6/a2]^T, the paper's [1 0 12]^T for the nominal injector: what the
nozzle flow lacks is missed by line and sac in this ratio (27).

The identification gain l of (5): between what the line does and what the samples show.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.paper.scheme import sweep
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.paper_scheme.network import FreeNetwork
from observer_rt.foundation.errors import UserError
from observer_rt.model.effective import Coefficients
from observer_rt.model.network import Network

WELL_ABOVE = 4.0  # times the line mode, below which the target of phi is mostly the fault's derivative
ROUNDING = 1e-9  # a sample rate may be known as the inverse of an interval
LARGEST_NOISE = 0.1  # of the nozzle flow at p_0, the noise of one sample of the target


class PaperSetting(NamedTuple):
    """Constants from event to event: sample interval [s], RK4 steps in it, model, gain l [1/s].

    nominal: a network that says phi = 0, for f(x, u) itself.
    """

    interval: float
    substeps: int
    coefficients: Coefficients
    nominal: Network
    gain: float


class EventPass(NamedTuple):
    """One event swept once, n samples: x^ (n, 3), phi (n, 3) [1/s], Q_H^ (n,) [m3/s], e~ (n,) in units of p_0.

    `driven` (n,): the samples at which x^ runs on phi; before the opening and with the needle long shut it is x~.
    """

    x: NDArray[np.float64]
    phi: NDArray[np.float64]
    rate: NDArray[np.float64]
    error: NDArray[np.float64]
    driven: NDArray[np.bool_]


def design_vector(c: Coefficients) -> NDArray[np.float64]:
    """L = [1 0 a6/a2]^T (3,), which gives line and sac their share of the measured error."""
    return np.array([1.0, 0.0, c.sac.a6 / c.line.a2_nozzle])


def swept(window: Window, setting: PaperSetting, network: FreeNetwork) -> EventPass:
    """One pass over an event (n samples) with fixed weights, into new memory."""
    samples = window.output.shape[0]
    result = EventPass(
        x=np.zeros((samples, 3)),
        phi=np.zeros((samples, 3)),
        rate=np.zeros(samples),
        error=np.zeros(samples),
        driven=np.zeros(samples, np.bool_),
    )
    sweep(window, setting, network, result)
    return result


def check_gain(place: str, gain: float, c: Coefficients, sample_rate: float) -> None:
    """Refuse a gain l [1/s] that cannot identify anything at `sample_rate` [Hz].

    L l e~ is the fault through l s / (s^2 + l s + w^2), w the line mode: a high pass that only a gain well above w
    moves out of the way. Above the sample rate there is nothing between two samples for x~ to follow.
    Raises `UserError` naming `place`.
    """
    lowest = WELL_ABOVE * c.line.mode
    if gain <= c.line.mode:
        raise UserError(
            place,
            f"{gain:g} 1/s is not above the line's own {c.line.mode:.0f} rad/s: x~ would follow the fault",
            f"give {lowest:.2g} to {sample_rate:g} 1/s"
            if lowest < sample_rate
            else f"sample at {lowest:.2g} Hz or more, and give a gain up to that",
        )
    if gain > sample_rate * (1.0 + ROUNDING):
        raise UserError(
            place,
            f"{gain:g} 1/s is faster than the samples, {sample_rate:g} Hz",
            f"give at most {sample_rate:g} 1/s, or sample faster",
        )


def doubts_about_gain(gain: float, c: Coefficients, noise: NoiseLevels) -> str | None:
    """Objection to an admissible gain l [1/s]; None: there is none."""
    if gain < WELL_ABOVE * c.line.mode:
        return (
            f"only {gain / c.line.mode:.2g} times the line's own {c.line.mode:.0f} rad/s: "
            "the target of phi is mostly the derivative of the fault"
        )
    share = gain * noise.line_pressure / c.pressure_scale / c.line.a2_nozzle
    if share > LARGEST_NOISE:
        return f"a sample of the target of phi has noise of {share:.0%} of the nozzle flow"
    return None
