"""Opens MDF4 files by asammdf, whose failures on damaged ones become errors that name the file; to be run apart."""

import gc
import logging
import struct
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from asammdf import MDF
from asammdf.blocks.utils import MdfException
from asammdf.blocks.v4_blocks import FileHistory

from observer_rt.files.mdf4.reader_process import READABLE, refuse_other_files
from observer_rt.foundation.errors import UserError

DAMAGE = (  # the ways in which asammdf fails on a damaged file
    MdfException,
    struct.error,
    OSError,
    MemoryError,
    ArithmeticError,
    ValueError,
    LookupError,
    EOFError,
    TypeError,
    AttributeError,
)
logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # its complaints come as errors, too
_ANY_SIZE = 1 << 62  # bytes
NO_DATE = datetime.fromtimestamp(0, UTC)


@contextmanager
def opened(path: Path) -> Iterator[MDF]:
    """A file to read; the many ways in which asammdf fails on a damaged one become a `UserError`.

    One that is not finalised asammdf finalises in a temporary copy.
    """
    refuse_other_files(path)
    with damage_told(path), MDF(path) as file:
        yield file


@contextmanager
def damage_told(path: Path) -> Iterator[None]:
    """Turn asammdf's own errors into `UserError`."""
    try:
        yield
    except DAMAGE as error:
        discard(error)
        raise UserError(str(path), f"a damaged MDF file: {error}", READABLE) from None


def add_history(file: MDF) -> None:
    """Name what wrote the file, but not when: the same content gives the same bytes."""
    file.start_time = NO_DATE
    history = FileHistory()
    history.time_stamp = NO_DATE
    history.comment = "<FHcomment><TX>created</TX><tool_id>observer-rt</tool_id></FHcomment>"
    file.file_history.append(history)


def discard(error: Exception) -> None:
    """Drop the half-read file: asammdf's destructor fails on it, which would print a traceback later on."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
    finally:
        sys.unraisablehook = hook


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
    """Number of records that the data of a group hold, stated or not; as stated where nothing is stored of them."""
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
        address=address,
        stream=mdf._file,
        mapped=mdf._mapped,
        total_size=_ANY_SIZE,
        inval_total_size=_ANY_SIZE,
    )
    return sum(block.original_size for block in blocks)
