"""Arrays that NumPy saved, `.npy` and `.npz`; nothing in them is executed."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from observer_rt.files.signals.column import Column
from observer_rt.files.whole.arrays import columns_of_array


def columns(path: Path) -> Iterator[Column]:
    """Columns of all arrays by their names; of a matrix by place."""
    held = np.load(path, allow_pickle=False)
    if isinstance(held, np.ndarray):
        yield from columns_of_array("", held)
        return
    with held:
        for name in held.files:
            yield from columns_of_array(name, held[name])
