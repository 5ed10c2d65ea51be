"""The decorators of compiled functions: by whom one is called, and whether callers hold its code.

With them come changes to Numba: two faults mended, and two costs of compiling left out. Of what compiling for a first
`evaluate` takes, comparing flags was 6 %, reporting every entry into LLVM 6 %. What is compiled is the same.
"""

import hashlib
import importlib
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from llvmlite import binding
from llvmlite.binding import ffi
from numba import njit
from numba.core import cgutils
from numba.core.caching import IndexDataCacheFile
from numba.core.compiler import CompileResult
from numba.core.imputils import fix_returning_optional, impl_ret_new_ref
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import TargetConfig

compiled = njit(cache=True, nogil=True, no_cfunc_wrapper=True)
"""`njit` of what Python calls; without the entry from C."""

addressed = njit(cache=True, nogil=True, no_cpython_wrapper=True)
"""`njit` of what compiled code calls by address, see `foundation.bound`; without the entry from Python."""

inlined = njit(cache=True, nogil=True, inline="always")
"""`njit` of a function whose text is put where it is called."""

inner = njit(cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""`compiled` without the entry from Python: that takes most of the time in which a small function compiles.

Called from Python such a function crashes; tests/foundation/test_compiled.py forbids it.
"""

inner_inlined = njit(cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)
"""`inner` of a function whose code LLVM puts where it is called."""


def separate(function: Callable[..., Any]) -> Any:
    """`njit` of a function whose code its callers do not hold: they call it by a symbol.

    Numba compiles all that a function calls once more into it, so that what lies deep is compiled as often as it is
    deep. A call by symbol costs some nanoseconds, more with arguments of many leaves, and nothing is inlined.
    """
    return _decorated(function, {"no_cfunc_wrapper": True})


def inner_separate(function: Callable[..., Any]) -> Any:
    """`separate` and `inner` at once."""
    return _decorated(function, {"no_cpython_wrapper": True, "no_cfunc_wrapper": True})


def _decorated(function: Callable[..., Any], options: dict[str, bool]) -> Any:
    found = _SeparateDispatcher(function, targetoptions={"nopython": True, "nogil": True} | options)
    found.enable_caching()
    return found


class _SeparateDispatcher(CPUDispatcher):
    def add_overload(self, cres: Any) -> None:
        """Take over what was compiled or loaded, and let callers reach it by its symbol instead."""
        super().add_overload(cres)
        needed = _Needed(self.py_func.__module__, self.py_func.__name__, tuple(cres.signature.args))
        binding.add_symbol(needed.symbol, cres.library.get_pointer_to_function(cres.fndesc.llvm_func_name))
        implementation = _call_by_symbol(needed, cres.fndesc)
        self.targetctx.insert_func_defn([(implementation, cres.entry_point, implementation.signature)])


@dataclass(frozen=True)
class _Needed:
    """What must be there before code that calls it can be loaded: a function for these types of arguments."""

    module: str
    name: str
    types: tuple[Any, ...]

    @property
    def symbol(self) -> str:
        digest = hashlib.sha256(repr(self.types).encode()).hexdigest()
        return f"{self.module}.{self.name}.{digest[:24]}"

    def __call__(self) -> None:
        """Load it, or compile it; Numba calls this before it loads code that was kept."""
        getattr(importlib.import_module(self.module), self.name).compile(self.types)


def _call_by_symbol(needed: _Needed, description: Any) -> Any:
    """For Numba: how a caller calls it; as Numba's own, but for the symbol and the library that is not linked."""

    def implementation(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds, result = description.argtypes, description.restype
        convention = context.call_conv
        function = cgutils.get_or_insert_function(
            builder.module, convention.get_function_type(result, kinds), needed.symbol
        )
        convention.decorate_function(function, description.args, kinds, noalias=False)
        context.active_code_library._reload_init.add(needed)
        status, value = convention.call_function(builder, function, result, kinds, arguments)
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        value = fix_returning_optional(context, builder, signature, status, value)
        return impl_ret_new_ref(context, builder, result, value)

    implementation.signature = description.argtypes  # type: ignore[attr-defined]
    implementation.libs = ()  # type: ignore[attr-defined]
    return implementation


_rebuild = CompileResult._rebuild


def _rebuilt(*kept: Any) -> Any:
    """Numba's own, and the library notes what it needs: else a caller compiled later, that holds it, is not."""
    found = _rebuild(*kept)
    found.library._reload_init.update(found.reload_init)
    return found


_load_index, _load_data = IndexDataCacheFile._load_index, IndexDataCacheFile._load_data
_UNUSABLE = (ImportError, AttributeError, EOFError, pickle.UnpicklingError)


def _index_at_hand(self: Any) -> Any:
    """Numba's own; one that names types of another version, or was cut short, is none."""
    try:
        return _load_index(self)
    except _UNUSABLE:
        return {}


def _data_at_hand(self: Any, name: str) -> Any:
    """Numba's own; for what cannot be read it takes an OSError only."""
    try:
        return _load_data(self, name)
    except _UNUSABLE as error:
        raise OSError(f"{name}: {error}") from error


def _equals(self: Any, other: object) -> Any:
    """Numba's own, after a look at what is set, which mostly decides it."""
    if not isinstance(other, TargetConfig):
        return NotImplemented
    return self._values == other._values or self.values() == other.values()


def _hashed(self: Any) -> int:
    """Numba's own sorts the names of all options, for the same."""
    return hash(type(self))


CompileResult._rebuild = _rebuilt
IndexDataCacheFile._load_index, IndexDataCacheFile._load_data = _index_at_hand, _data_at_hand
TargetConfig.__eq__ = _equals
TargetConfig.__hash__ = _hashed
for _callbacks in tuple(getattr(ffi.lib._lock, "_cblist", ())):  # they time what nobody reads
    ffi.unregister_lock_callback(*_callbacks)
