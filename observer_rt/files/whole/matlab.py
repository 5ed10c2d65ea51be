"""MATLAB files up to version 7: arrays of numbers, also in structures; those of 7.3 are HDF5."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, matlab

from observer_rt.files.signals.column import Column
from observer_rt.files.signals.whole_file import require
from observer_rt.files.whole.arrays import columns_of_array
from observer_rt.foundation.errors import UserError

_HDF5 = b"MATLAB 7.3"


def columns(path: Path) -> Iterator[Column]:
    """Columns of all arrays; those of a structure by `structure/field`."""
    with path.open("rb") as file:
        is_hdf5 = file.read(len(_HDF5)) == _HDF5
    if is_hdf5:
        require(path, "h5py", "h5py")
        from observer_rt.files.whole import hdf5

        yield from hdf5.columns(path)
        return
    content = loadmat(path, squeeze_me=True, chars_as_strings=True)
    found = [
        column for name, value in content.items() if name[:2] != "__" for column in _columns(name, value)
    ]
    if not found and any(isinstance(value, matlab.MatlabOpaque) for value in content.values()):
        raise UserError(
            str(path),
            "holds a table, timetable or other object, which only MATLAB can read",
            'in MATLAB: parquetwrite("file.parquet", T); or s = table2struct(T, "ToScalar", true); '
            'save("file.mat", "-struct", "s")',
        )
    yield from found


def _columns(name: str, value: Any) -> Iterator[Column]:
    if not isinstance(value, np.ndarray) or isinstance(value, matlab.MatlabOpaque):
        return
    if value.dtype.names:
        if value.size == 1:
            for field in value.dtype.names:
                yield from _columns(f"{name}/{field}", np.asarray(value[field].item()))
    else:
        yield from columns_of_array(name, value)
