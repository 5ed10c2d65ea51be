"""MDF 3 (`.mdf`, `.dat`): channels with units, each on the time of its group."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from asammdf import MDF

from observer_rt.files.signals.column import Column
from observer_rt.foundation.errors import UserError

_MAGIC = b"MDF     "


def columns(path: Path) -> Iterator[Column]:
    """Channels of numbers but for those of time."""
    with path.open("rb") as file:
        head = file.read(16)
    if not head.startswith(_MAGIC):
        raise UserError(str(path), "is no MDF file", "give one, or name the file by its kind")
    if head[len(_MAGIC) : len(_MAGIC) + 2] == b"4.":
        raise UserError(str(path), "is MDF 4", f"name it {path.stem}.mf4")
    with MDF(path) as file:
        for number, group in enumerate(file.groups):
            for index, channel in enumerate(group.channels):
                if file.masters_db.get(number) == index:
                    continue
                signal = file.get(group=number, index=index)
                if signal.samples.ndim == 1 and signal.samples.dtype.kind in "iuf":
                    time = signal.timestamps.astype(np.float64)
                    yield Column(channel.name, signal.samples, str(signal.unit).strip(), time, number)
