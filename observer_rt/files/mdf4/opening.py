"""Opens MDF4 files by asammdf, apart (`mdf4_apart`), for it trusts what stands in a file; failure means damage."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Signal

from observer_rt.files.mdf4.reader_process import READABLE, Answer
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats

MAGICS = (b"MDF     ", b"UnFinMF ")  # complete, and as a logger leaves it
MAJOR_VERSION = b"4."
_ANY_SIZE = 1 << 62  # bytes


@contextmanager
def open_mdf(path: Path) -> Iterator[MDF]:
    """A file to read; one that is not finalised asammdf finalises in a temporary copy."""
    with path.open("rb") as stored:
        mark, version = stored.read(len(MAGICS[0])), stored.read(len(MAJOR_VERSION))
    if mark not in MAGICS:
        raise UserError(str(path), "not an MDF file", READABLE)
    if version != MAJOR_VERSION:
        raise UserError(str(path), f"is of MDF {version.decode('ascii', 'replace')}, not 4", READABLE)
    with MDF(path) as file:
        yield file


def refuse_outside(file: MDF, group: int) -> None:
    """Raise `ValueError` for a field that reaches beyond its record: asammdf would read there all the same."""
    record = file.groups[group].channel_group.samples_byte_nr
    for channel in file.groups[group].channels:
        end = channel.byte_offset + (channel.bit_offset + channel.bit_count + 7) // 8
        if end > record:
            raise ValueError(f"{channel.name} reaches to byte {end} of records of {record}")


def record_size(group: Any) -> int:
    """Bytes of a record, at least 1."""
    invalidation = 0 if group.uses_ld else group.channel_group.invalidation_bytes_nr
    return max(1, int(group.channel_group.samples_byte_nr + invalidation))


def stored_records(file: MDF, group: Any) -> int:
    """Number of records in the data of a group, stated or not; the stated number where a record has no bytes."""
    if not group.channel_group.samples_byte_nr:
        return int(group.channel_group.cycles_nr)
    if group.data_group.record_id_len:
        size = sum(block.original_size for block in group.get_data_blocks())
    else:
        size = stored_bytes(file, group.data_group.data_block_addr)
    return int(size // record_size(group))


def stored_bytes(file: MDF, address: int) -> int:
    """Bytes of data at an address, unpacked; asammdf ignores bytes behind the stated records."""
    mdf = file._mdf
    blocks = mdf._get_data_blocks_info(
        address=address, stream=mdf._file, mapped=mdf._mapped, total_size=_ANY_SIZE, inval_total_size=_ANY_SIZE
    )
    return sum(block.original_size for block in blocks)


def channels(path: Path) -> Iterator[Answer]:
    """Name, unit, group and index of every channel but times, and samples its group holds beyond its heading."""
    with open_mdf(path) as file:
        surplus = {
            number: stored_records(file, group) - int(group.channel_group.cycles_nr)
            for number, group in enumerate(file.groups)
        }
        for name, places in file.channels_db.items():
            for group, index in places:
                refuse_outside(file, group)
                if index != file.masters_db.get(group):
                    yield (name, _unit(file, group, index), int(group), int(index), surplus[group]), {}


def parts(path: Path, group: int, indices: Mapping[str, int], at_once: int) -> Iterator[Answer]:
    """Time [s] and channels of one group by name, `at_once` samples a part; NaN where a sample is marked invalid.

    A channel of no plain numbers is empty. Raises `ValueError` where fewer samples are read than there are.
    """
    with open_mdf(path) as file:
        refuse_outside(file, group)
        samples = min(file.groups[group].channel_group.cycles_nr, stored_records(file, file.groups[group]))
        for first in range(0, samples, at_once):
            count = min(at_once, samples - first)
            channels = {
                name: file.get(
                    group=group, index=index, ignore_invalidation_bits=True, record_offset=first, record_count=count
                )
                for name, index in indices.items()
            }
            columns = {name: _numbers(signal, count) for name, signal in channels.items()}
            yield None, {"time": next(iter(channels.values())).timestamps.astype(np.float64), **columns}


def _unit(file: MDF, group: int, index: int) -> str:
    """Unit of a channel, or of its conversion."""
    channel = file.groups[group].channels[index]
    unit = channel.unit or (channel.conversion.unit if channel.conversion is not None else "")
    return str(unit or "").strip()


def _numbers(signal: Signal, count: int) -> Floats:
    if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "buif":
        return np.empty(0)
    values: Floats = signal.samples.astype(np.float64)
    marks = values if signal.invalidation_bits is None else signal.invalidation_bits
    if not values.size == signal.timestamps.size == len(marks) == count:
        raise ValueError(f"{signal.name} has {values.size} samples, {signal.timestamps.size} stamps, not {count}")
    if signal.invalidation_bits is not None:
        values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
    return values
