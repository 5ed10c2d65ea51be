"""Arrays without a count of who uses them, for loops of compiled code that hand many on at every step.

Numba counts the users of an array at every call it is given to: with the fifteen arrays of a tangent that takes
longer than the arithmetic, even where there is nothing to count. A borrowed array is of a type that has no count;
whoever lent it must keep it while it is used.
"""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from observer_rt.foundation.compiled import inner
from observer_rt.model.line.interface import Slopes
from observer_rt.model.network import Network
from observer_rt.model.right_hand_side import ByTheta, Tangent


class _Borrowed(types.Array):
    """An array to compiled code, as are its rows and slices."""

    def __init__(self, dtype: Any, ndim: int, layout: str) -> None:
        super().__init__(dtype, ndim, layout, name=f"Borrowed({dtype}, {ndim}, {layout})")

    def copy(
        self,
        dtype: Any = None,
        ndim: int | None = None,
        layout: str | None = None,
        readonly: bool | None = None,
    ) -> "_Borrowed":
        """The same type but for what is given."""
        return _Borrowed(dtype or self.dtype, self.ndim if ndim is None else ndim, layout or self.layout)


@register_model(_Borrowed)
class _BorrowedModel(models.StructModel):
    """That of an array, with pointers that nobody counts in the places of its owners."""

    def __init__(self, manager: Any, kind: _Borrowed) -> None:
        sizes = types.UniTuple(types.intp, kind.ndim)
        members = [
            ("meminfo", types.voidptr),
            ("parent", types.voidptr),
            ("nitems", types.intp),
            ("itemsize", types.intp),
            ("data", types.CPointer(kind.dtype)),
            ("shape", sizes),
            ("strides", sizes),
        ]
        super().__init__(manager, kind, members)


@intrinsic
def borrowed(typing_context: Any, array: Any) -> Any:
    """The same array, uncounted; one that lies in a record is an array like any other."""
    if not isinstance(array, types.Array):
        return None
    kind = _Borrowed(array.dtype, array.ndim, array.layout)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        held = context.make_array(signature.args[0])(context, builder, arguments[0])
        lent = context.make_array(kind)(context, builder)
        for name in ("nitems", "itemsize", "data", "shape", "strides"):
            setattr(lent, name, getattr(held, name))
        for name in ("meminfo", "parent"):
            setattr(lent, name, cgutils.get_null_value(getattr(lent, name).type))
        return lent._getvalue()

    return kind(array), codegen


@inner
def borrowed_network(network: Network) -> Network:
    """A network of borrowed arrays."""
    return Network(
        borrowed(network.hidden),
        borrowed(network.output),
        borrowed(network.bias),
        borrowed(network.back_pressure),
    )


@inner
def borrowed_tangent(tangent: Tangent) -> Tangent:
    """A tangent of borrowed arrays."""
    slopes, theta = tangent.slopes, tangent.theta
    return Tangent(
        borrowed(tangent.by),
        borrowed(tangent.moved),
        borrowed(tangent.by_state),
        borrowed(tangent.by_number),
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
