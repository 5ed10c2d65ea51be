"""Channels of an MDF4 file, by asammdf; to be run apart, for it trusts what stands in a file.

What goes to the caller are lists, texts, numbers and arrays.
"""

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Signal
from numpy.typing import NDArray

from observer_rt.files.mdf4.opening import damage_told, opened, refuse_outside, stored_records
from observer_rt.files.mdf4.reader_process import MAGICS

_HEAD = struct.Struct("<4s4xQQ")  # of a block: its kind, length, number of links
_CYCLES = struct.Struct("<8xQ")  # of a group's heading, behind its links


def channels(path: Path) -> Iterator[list[Any]]:
    """Name, unit, group and index of every channel but the times, and how many more samples its group holds than its
    heading states.
    """
    with opened(path) as file, damage_told(path):
        surplus = {
            number: stored_records(file, group) - _stated(path, group)
            for number, group in enumerate(file.groups)
        }
        for name, places in file.channels_db.items():
            for group, index in places:
                refuse_outside(file, group)
                if index != file.masters_db.get(group):
                    yield [name, _unit(file, group, index), int(group), int(index), surplus[group]]


def parts(
    path: Path, group: int, indices: Mapping[str, int], at_once: int
) -> Iterator[dict[str, NDArray[Any]]]:
    """Time [s] and channels of one group by name, so many samples at once; NaN where a sample is marked invalid.

    A channel that holds no plain numbers is empty. Raises `UserError` where fewer samples are read than there are.
    """
    with opened(path) as file, damage_told(path):
        refuse_outside(file, group)
        samples = min(file.groups[group].channel_group.cycles_nr, stored_records(file, file.groups[group]))
        for first in range(0, samples, at_once):
            count = min(at_once, samples - first)
            channels = {
                name: file.get(
                    group=group,
                    index=index,
                    ignore_invalidation_bits=True,
                    record_offset=first,
                    record_count=count,
                )
                for name, index in indices.items()
            }
            columns = {name: _numbers(signal, count) for name, signal in channels.items()}
            yield {"time": next(iter(channels.values())).timestamps.astype(np.float64), **columns}


def _stated(path: Path, group: Any) -> int:
    """Number of samples by the heading in the file; of one that is not finalised, or without, that of asammdf."""
    heading = group.channel_group
    with path.open("rb") as raw:
        if raw.read(len(MAGICS[0])) != MAGICS[0] or not heading.address:
            return int(heading.cycles_nr)
        raw.seek(heading.address)
        _, _, links = _HEAD.unpack(raw.read(_HEAD.size))
        raw.seek(8 * links, 1)
        return int(_CYCLES.unpack(raw.read(_CYCLES.size))[0])


def _unit(file: MDF, group: int, index: int) -> str:
    """Unit of a channel, or of its conversion."""
    channel = file.groups[group].channels[index]
    unit = channel.unit or (channel.conversion.unit if channel.conversion is not None else "")
    return str(unit or "").strip()


def _numbers(signal: Signal, count: int) -> NDArray[np.float64]:
    if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "buif":
        return np.empty(0)
    values: NDArray[np.float64] = signal.samples.astype(np.float64)
    marks = values if signal.invalidation_bits is None else signal.invalidation_bits
    if not values.size == signal.timestamps.size == len(marks) == count:
        raise ValueError(
            f"{signal.name} has {values.size} samples, {signal.timestamps.size} stamps, not {count}"
        )
    if signal.invalidation_bits is not None:
        values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
    return values
