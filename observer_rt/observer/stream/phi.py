"""What x^ carries as phi: chosen once, when the observer is made, and compiled for by its type."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled
from observer_rt.model.effective import Coefficients
from observer_rt.model.integrator import Interval, advance_over
from observer_rt.model.network import Network
from observer_rt.model.right_hand_side import fault_and_rate


class Phi(Protocol):
    """A named tuple of arrays that compiled code reads; what is learned is put into them in place."""

    def nozzle_wear(self, x: NDArray[np.float64], u: NDArray[np.float64], c: Coefficients) -> float | None:
        """v_H of (27) at state x (3,) and inputs u (2,); None where theta says it."""


class StructuredPhi(NamedTuple):
    """phi = G(x, u) N of theta: the network that x~ carries as well, in the observer's memory."""

    def nozzle_wear(self, x: NDArray[np.float64], u: NDArray[np.float64], c: Coefficients) -> None:
        """Theta says it."""


def advance_x_hat(
    phi: Any,
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
) -> None:
    """x^ (n,) a sample interval later, in place; arguments as of `integrator.advance_over`. For compiled code."""
    raise NotImplementedError


def read_phi(
    phi: Any,
    x: NDArray[np.float64],
    u: tuple[float, float],
    c: Coefficients,
    network: Network,
) -> tuple[tuple[float, float, float], float]:
    """The three rows of phi [1/s] and the injection rate [m3/s] at a state not at rest. For compiled code."""
    raise NotImplementedError


def put_into(phi: Any, posted: Any, slot: int) -> None:
    """Replace what x^ carries by a slot of what was posted, in place. For compiled code."""
    raise NotImplementedError


def carry(kind: type, advance: Callable[..., Any], read: Callable[..., Any], put: Callable[..., Any]) -> None:
    """Make `advance_x_hat`, `read_phi`, `put_into` of this kind of phi; compiled, with the same arguments."""

    def chosen(compiled: Any) -> Callable[..., Any]:
        return lambda phi, *_: compiled.py_func if getattr(phi, "instance_class", None) is kind else None

    overload(advance_x_hat, strict=False)(chosen(advance))
    overload(read_phi, strict=False)(chosen(read))
    overload(put_into, strict=False)(chosen(put))


@compiled
def _advance_structured(
    phi: StructuredPhi,
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
) -> None:
    advance_over(x, interval, knot, c, network, None)


@compiled
def _read_structured(
    phi: StructuredPhi,
    x: NDArray[np.float64],
    u: tuple[float, float],
    c: Coefficients,
    network: Network,
) -> tuple[tuple[float, float, float], float]:
    rows, rate = fault_and_rate(x, u, c, network)
    return rows, rate


@compiled
def _put_structured(phi: StructuredPhi, posted: StructuredPhi, slot: int) -> None:
    """Theta says it."""


carry(StructuredPhi, _advance_structured, _read_structured, _put_structured)
