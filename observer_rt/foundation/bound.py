"""Compiled functions bound to a tuple and called by address: a caller knows neither the function nor the tuple.

So what a caller is compiled for does not change with what it calls: an observer is the same code for every line.
"""

from typing import Any, NamedTuple

from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.extending import intrinsic

from observer_rt.foundation.referenced import leaves_of


class Bound(NamedTuple):
    """Where the code of a function begins, and the leaves of the tuple it is bound to."""

    code: int
    data: int


def bind(function: Any, value: Any) -> tuple[Bound, Any]:
    """A compiled function (value, what, place) -> float bound to a referenced tuple; it raises nothing.

    And what must be kept while it may be called.
    """
    signature = (typeof(value), types.int64, types.int64)
    function.compile(signature)
    found = function.overloads[signature]
    leaves = leaves_of(value)
    code = found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name)
    return Bound(int(code), leaves.ctypes.data), (value, leaves)


@intrinsic
def call(typing_context: Any, bound: Any, what: Any, place: Any) -> Any:
    """What a bound function returns of two integers; for compiled code."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        code, data = (builder.extract_value(arguments[0], number) for number in range(2))
        integer, real = context.get_value_type(types.int64), context.get_value_type(types.float64)
        kind = ir.FunctionType(real, [cgutils.voidptr_t, integer, integer])
        function = builder.inttoptr(code, kind.as_pointer())
        return builder.call(function, [builder.inttoptr(data, cgutils.voidptr_t), arguments[1], arguments[2]])

    return types.float64(bound, types.int64, types.int64), codegen
