"""Changes to Numba: one fault mended, and two costs of compiling left out, a tenth of its time.

Of what compiling for a first `evaluate` takes, comparing flags was 6 %, reporting every entry into LLVM 6 %. What is
compiled is the same.
"""

from typing import Any

from llvmlite.binding import ffi
from numba.core.compiler import CompileResult
from numba.core.targetconfig import TargetConfig

_rebuild = CompileResult._rebuild


def _rebuilt(*kept: Any) -> Any:
    """Numba's own, and the library is told what it needs: else a caller compiled later, that holds it, is not."""
    found = _rebuild(*kept)
    found.library._reload_init.update(found.reload_init)
    return found


def _equals(self: Any, other: object) -> Any:
    """Numba's own, after a look at what is set, which mostly decides it."""
    if not isinstance(other, TargetConfig):
        return NotImplemented
    return self._values == other._values or self.values() == other.values()


def _hashed(self: Any) -> int:
    """Numba's own sorts the names of all options, for the same."""
    return hash(type(self))


CompileResult._rebuild = _rebuilt
TargetConfig.__eq__ = _equals
TargetConfig.__hash__ = _hashed
for _callbacks in tuple(getattr(ffi.lib._lock, "_cblist", ())):  # they time what nobody reads
    ffi.unregister_lock_callback(*_callbacks)
