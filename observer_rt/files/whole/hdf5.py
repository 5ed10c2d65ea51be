"""HDF5, MATLAB 7.3 among it: every array of numbers, by its path. Links to other files are not followed."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from observer_rt.files.signals.column import Column
from observer_rt.files.whole.arrays import columns_of_array

_UNITS = ("unit", "units", "Unit", "Units", "UNIT", "unit_string")  # attributes
_MATLABS_OWN = "#"  # begins groups of what MATLAB keeps for itself


def columns(path: Path) -> Iterator[Column]:
    """Columns of all arrays, by `group/name`."""
    with h5py.File(path, "r") as file:
        yield from _within(file, "")


def _within(group: Any, prefix: str) -> Iterator[Column]:
    for name in group:
        link = group.get(name, getlink=True)
        if name.startswith(_MATLABS_OWN) or not isinstance(link, h5py.HardLink):
            continue
        found = group[name]
        if isinstance(found, h5py.Group):
            yield from _within(found, f"{prefix}{name}/")
        elif isinstance(found, h5py.Dataset) and _is_plain(found):
            yield from columns_of_array(f"{prefix}{name}", np.asarray(found[()]), _unit(found))


def _is_plain(found: Any) -> bool:
    """Whether an array of numbers, or a table of them, is in this file."""
    kinds = [found.dtype[name].kind for name in found.dtype.names or ()] or [found.dtype.kind]
    if found.attrs.get("MATLAB_class") == b"char":
        return False
    is_here = found.external is None and not found.is_virtual
    return is_here and found.size is not None and found.size > 1 and any(kind in "iuf" for kind in kinds)


def _unit(found: Any) -> str:
    for name in _UNITS:
        if (value := found.attrs.get(name)) is not None:
            value = np.asarray(value).ravel()[0] if np.size(value) else ""
            return (value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)).strip()
    return ""
