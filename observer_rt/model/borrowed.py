"""Arrays without a count of who uses them, for loops of compiled code that hand many on at every step.

Numba counts the users of an array at every call it is given to, atomically: with the fifteen arrays of a tangent that
takes longer than the arithmetic. A borrowed array is not counted; whoever lent it must keep it while it is used.
"""

from typing import Any

from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from observer_rt.model.line.interface import Slopes
from observer_rt.model.network import Network
from observer_rt.model.right_hand_side import ByTheta, Tangent


@intrinsic
def borrowed(typing_context: Any, array: Any) -> Any:
    """The same array, uncounted; one that lies in a record is an array like any other."""
    if not isinstance(array, types.Array):
        return None
    is_nested = isinstance(array, types.NestedArray)
    kind = types.Array(array.dtype, array.ndim, "C") if is_nested else array

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        held = context.make_array(array)(context, builder, arguments[0])
        result = context.make_array(kind)(context, builder)
        result.meminfo = cgutils.get_null_value(result.meminfo.type)
        result.parent = cgutils.get_null_value(result.parent.type)
        for name in ("nitems", "itemsize", "data", "shape", "strides"):
            setattr(result, name, getattr(held, name))
        return result._getvalue()

    return kind(array), codegen


@njit(cache=True, nogil=True)
def borrowed_network(network: Network) -> Network:
    """A network of borrowed arrays."""
    return Network(
        borrowed(network.hidden),
        borrowed(network.output),
        borrowed(network.bias),
        borrowed(network.back_pressure),
    )


@njit(cache=True, nogil=True)
def borrowed_tangent(tangent: Tangent) -> Tangent:
    """A tangent of borrowed arrays."""
    slopes, theta = tangent.slopes, tangent.theta
    return Tangent(
        borrowed(tangent.by),
        borrowed(tangent.moved),
        borrowed(tangent.stages),
        Slopes(
            borrowed(slopes.by_state),
            borrowed(slopes.by_rail),
            borrowed(slopes.by_flow),
            borrowed(slopes.by_coefficient),
        ),
        borrowed(tangent.sigmas),
        ByTheta(
            theta.nozzle_bias,
            theta.nozzle_weight,
            theta.seat_bias,
            theta.back_pressure,
            borrowed(theta.line_columns),
            borrowed(theta.line_coefficients),
            borrowed(theta.line_slopes),
        ),
    )
