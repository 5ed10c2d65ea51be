"""Named tuples that compiled code is given as one pointer, whatever they hold.

Numba passes a named tuple leaf by leaf, and counts the users of every array in it, atomically, at every call that it
does not inline. With a hundred leaves that is most of what the code does, of its size, and of the time to compile it.

Of what is reached by such a pointer nothing is counted: Python, who owns the tuple, must keep it while compiled code
runs. Its elements are read where they are used; one that is a referenced tuple, too, is a pointer again.
"""

import hashlib
from typing import Any, TypeVar

from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    register_model,
    typeof_impl,
    unbox,
)

_Kind = TypeVar("_Kind", bound=type)
_kinds: set[type] = set()


class Reference(types.Type):
    """Type of the pointer; `tuple_type` of what it points to, by value."""

    def __init__(self, tuple_type: Any) -> None:
        self.tuple_type = tuple_type
        kind = tuple_type.instance_class
        # the whole name would be part of the name of every function that takes one
        digest = hashlib.sha256(f"{kind.__module__}.{tuple_type}".encode()).hexdigest()
        super().__init__(f"Reference({kind.__name__}, {digest[:24]})")

    def element(self, name: str) -> tuple[int, Any]:
        """Its place, and its type by value."""
        place = self.tuple_type.fields.index(name)
        return place, self.tuple_type.types[place]


def referenced(kind: _Kind) -> _Kind:
    """Class decorator: compiled code is given such named tuples by reference, from Python and from within others."""
    _kinds.add(kind)

    @typeof_impl.register(kind)
    def _type_of(value: Any, context: Any) -> Reference:
        return Reference(_type_by_value(value, context))

    return kind


def _type_by_value(value: Any, context: Any) -> Any:
    if not isinstance(value, tuple):
        return typeof_impl(value, context)
    return types.BaseTuple.from_types([_type_by_value(each, context) for each in value], type(value))


def _is_referenced(kind: Any) -> bool:
    return isinstance(kind, types.BaseNamedTuple) and kind.instance_class in _kinds


register_model(Reference)(models.OpaqueModel)


@unbox(Reference)
def _unbox(kind: Reference, value: Any, c: Any) -> NativeValue:
    """On the stack of the entry."""
    native = c.unbox(kind.tuple_type, value)
    place = cgutils.alloca_once_value(c.builder, native.value)
    pointer = c.builder.bitcast(place, cgutils.voidptr_t)
    return NativeValue(pointer, is_error=native.is_error, cleanup=native.cleanup)


@infer_getattr
class _Elements(AttributeTemplate):
    key = Reference

    def generic_resolve(self, kind: Reference, name: str) -> Any:
        if name not in kind.tuple_type.fields:
            return None
        _, element = kind.element(name)
        return Reference(element) if _is_referenced(element) else element


@lower_getattr_generic(Reference)
def _element(context: Any, builder: Any, kind: Reference, value: Any, name: str) -> Any:
    place, element = kind.element(name)
    pointer = _typed(context, builder, kind, value)
    inner = cgutils.gep_inbounds(builder, pointer, 0, place)
    if _is_referenced(element):
        return builder.bitcast(inner, cgutils.voidptr_t)
    return _load(context, builder, element, inner)


def _typed(context: Any, builder: Any, kind: Reference, value: Any) -> Any:
    return builder.bitcast(value, context.get_value_type(kind.tuple_type).as_pointer())


def _load(context: Any, builder: Any, kind: Any, pointer: Any) -> Any:
    """What is there, of arrays without their owner; leaf by leaf, so that leaves that are not used go."""
    if isinstance(kind, types.BaseTuple):
        leaves = [
            _load(context, builder, leaf, cgutils.gep_inbounds(builder, pointer, 0, place))
            for place, leaf in enumerate(kind.types)
        ]
        return context.make_tuple(builder, kind, leaves)
    if not isinstance(kind, types.Array):
        return builder.load(pointer)
    there = context.make_array(kind)(context, builder, ref=pointer)
    array = context.make_array(kind)(context, builder)
    array.meminfo = cgutils.get_null_value(array.meminfo.type)
    array.parent = cgutils.get_null_value(array.parent.type)
    array.nitems, array.data = there.nitems, there.data
    array.itemsize = context.get_constant(
        types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype))
    )
    array.shape, array.strides = there.shape, there.strides
    return array._getvalue()


@intrinsic
def by_value(typing_context: Any, reference: Any) -> Any:
    """The tuple itself, its arrays counted: for code that keeps it."""
    if not isinstance(reference, Reference):
        return None
    kind = reference.tuple_type

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        value = builder.load(_typed(context, builder, reference, arguments[0]))
        return impl_ret_borrowed(context, builder, kind, value)

    return kind(reference), codegen


def reference_to(builder: Any, pointer: Any) -> Any:
    """For intrinsics: LLVM's value of a `Reference` from that of a pointer to the tuple by value."""
    return builder.bitcast(pointer, cgutils.voidptr_t)
