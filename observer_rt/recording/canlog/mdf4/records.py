"""The CAN frames of MDF4 files as records, read by asammdf; to be run apart, for damage crashes its C code.

ASAM's rules for bus logging: one record a frame, groups apart by data, error and remote frames. A field may be
virtual: not stored, but given by the number of the record through its conversion, which makes a constant of it.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from asammdf import MDF
from asammdf.blocks.v4_constants import FLAG_CG_BUS_EVENT, VIRTUAL_TYPES
from numpy.typing import NDArray

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_MASK, FD_LENGTHS, length_of
from observer_rt.recording.canlog.can_log import NANOSECONDS
from observer_rt.recording.canlog.mdf4.merging import in_order_of_time
from observer_rt.recording.signals.mdf4_file import opened, refuse_outside

DATA, ERROR, REMOTE = "CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame"
EXTENDED_BIT = 31  # of identifiers, where a logger stores no IDE
RECORDS_AT_ONCE = 50_000
MAX_LENGTH = FD_LENGTHS[-1]
_LARGEST_NUMBER = 0xFFFF_FFFF
_BLOCK = struct.Struct("<4s4xQ8x")  # head of a block: kind, length with this head, links
CHANNEL_NAME = 16  # characters
_LARGEST_TIME = np.iinfo(np.int64).max
_LENGTH_OF_CODE = np.array([length_of(code) for code in range(16)])

RECORD = np.dtype(
    [
        ("stamp", np.int64),  # ns since 1970
        ("id", np.uint32),
        ("is_extended", np.bool_),
        ("length", np.uint8),
        ("data", np.uint8, MAX_LENGTH),
        ("is_fd", np.bool_),
        ("channel", f"U{CHANNEL_NAME}"),
        ("bit_rate_switch", np.bool_),
        ("error_state", np.bool_),
        ("is_sent", np.bool_),
    ]
)


class Totals(NamedTuple):
    """How many frames of each kind a log has."""

    data: int
    error: int
    remote: int
    uncounted: int
    """Records of data frames that are in the file, but beyond their number in its heading."""


def totals(path: Path) -> Iterator[Totals]:
    """How many frames a file has, once."""
    with opened(path) as file:
        yield _totals(file, path)


def records(path: Path) -> Iterator[Totals | NDArray[np.void]]:
    """How many frames a file has, then its data frames in arrays of dtype `RECORD`.

    Frames of several groups are put in order of time; what steps back within one group stays as it is.
    """
    with opened(path) as file:
        yield _totals(file, path)
        yield from in_order_of_time([_group_records(file, group) for group in _groups(file, DATA)])


def _totals(file: MDF, path: Path) -> Totals:
    data, error, remote = (
        sum(file.groups[group].channel_group.cycles_nr for group in _groups(file, kind))
        for kind in (DATA, ERROR, REMOTE)
    )
    return Totals(data, error, remote, sum(_uncounted(file, path, group) for group in _groups(file, DATA)))


def _uncounted(file: MDF, path: Path, group: int) -> int:
    """Records beyond the number in the heading, where they are in one plain block: asammdf passes them over."""
    place, heading = file.groups[group].data_group, file.groups[group].channel_group
    size = heading.samples_byte_nr + heading.invalidation_bytes_nr
    with path.open("rb") as content:
        content.seek(place.data_block_addr)
        kind, length = _BLOCK.unpack(content.read(_BLOCK.size))
    if kind != b"##DT" or place.record_id_len or not size:
        return 0
    uncounted: int = (length - _BLOCK.size) // size - heading.cycles_nr
    return max(0, uncounted)


def _groups(file: MDF, kind: str) -> list[int]:
    """Numbers of the groups that hold CAN frames of a kind."""
    return [
        number
        for number, group in enumerate(file.groups)
        if group.channel_group.flags & FLAG_CG_BUS_EVENT
        and group.channel_group.cycles_nr
        and any(channel.name == kind for channel in group.channels)
    ]


def _group_records(file: MDF, group: int) -> Iterator[NDArray[np.void]]:
    refuse_outside(file, group)
    fields = _Fields(file, group)
    for offset in range(0, file.groups[group].channel_group.cycles_nr, RECORDS_AT_ONCE):
        yield fields.read(offset)


class _Fields:
    """The fields of the frames in a group, by the names ASAM gives them."""

    def __init__(self, file: MDF, group: int) -> None:
        self._file = file
        self._group = group
        self._places = {
            channel.name.removeprefix(f"{DATA}."): number
            for number, channel in enumerate(file.groups[group].channels)
            if channel.name.startswith(f"{DATA}.")
        }
        missing = [name for name in ("ID", "DataBytes") if name not in self._places]
        if missing or not {"DataLength", "DLC"} & self._places.keys():
            raise ValueError(f"its frames have no {(*missing, 'DataLength')[0]}")

    def read(self, offset: int) -> NDArray[np.void]:
        """The next records from a place on, at most `RECORDS_AT_ONCE`."""
        identifiers = self._numbers("ID", offset)
        result = np.zeros(identifiers.size, RECORD)
        result["stamp"] = self._stamps(offset)
        result["id"] = identifiers & EXTENDED_MASK
        result["is_extended"] = self._flags("IDE", offset, identifiers >> EXTENDED_BIT)
        self._read_data(offset, result)
        result["is_fd"] = self._flags(
            "EDL", offset, result["length"] > CLASSIC_LENGTH
        )  # only FD carries more
        result["bit_rate_switch"] = self._flags("BRS", offset, False)
        result["error_state"] = self._flags("ESI", offset, False)
        result["channel"] = self._channels(offset)
        result["is_sent"] = self._are_sent(offset)
        return result

    def _stamps(self, offset: int) -> NDArray[np.int64]:
        signal = self._file.get(
            group=self._group,
            index=self._places["ID"],
            record_offset=offset,
            record_count=RECORDS_AT_ONCE,
            raw=True,
            ignore_invalidation_bits=True,
        )
        seconds = signal.timestamps.astype(np.float64)
        start = int(self._file.header.abs_time)
        latest = (_LARGEST_TIME - start) / NANOSECONDS
        if not np.all((seconds >= -start / NANOSECONDS) & (seconds <= latest)):
            raise ValueError("its frames have times before 1970, or after 2262")
        stamps: NDArray[np.int64] = np.rint(seconds * NANOSECONDS).astype(np.int64) + start
        return stamps

    def _raw(self, field: str, offset: int) -> NDArray[Any]:
        samples: NDArray[Any]
        samples, _ = self._file.get(
            group=self._group,
            index=self._places[field],
            record_offset=offset,
            record_count=RECORDS_AT_ONCE,
            samples_only=True,
            raw=True,
            ignore_invalidation_bits=True,
        )
        return samples

    def _values(self, field: str, offset: int, keeps_text: bool = False) -> NDArray[Any]:
        """A field after its conversion; text for a number only where nothing is stored, or `keeps_text`."""
        raw = self._raw(field, offset)
        channel = self._file.groups[self._group].channels[self._places[field]]
        if channel.conversion is None:
            return raw
        is_virtual = channel.channel_type in VIRTUAL_TYPES
        values: NDArray[Any] = channel.conversion.convert(
            raw, ignore_value2text_conversions=not (is_virtual or keeps_text)
        )
        return values

    def _numbers(self, field: str, offset: int) -> NDArray[np.int64]:
        return _whole(field, self._values(field, offset))

    def _flags(self, field: str, offset: int, default: NDArray[Any] | bool) -> NDArray[np.bool_]:
        return np.asarray(self._numbers(field, offset) if field in self._places else default).astype(np.bool_)

    def _channels(self, offset: int) -> NDArray[np.str_]:
        if "BusChannel" not in self._places:
            return np.array("1")
        values = self._values("BusChannel", offset)
        return _text(values) if _is_text(values) else _whole("BusChannel", values).astype(np.str_)

    def _are_sent(self, offset: int) -> NDArray[np.bool_]:
        if "Dir" not in self._places:
            return np.array(False)
        values = self._values("Dir", offset, keeps_text=True)
        if _is_text(values):
            return np.array([text.strip().lower() == "tx" for text in _text(values).tolist()], np.bool_)
        return _whole("Dir", values).astype(np.bool_)

    def _read_data(self, offset: int, result: NDArray[np.void]) -> None:
        if "DataLength" in self._places:
            lengths = self._numbers("DataLength", offset)
        else:
            lengths = _LENGTH_OF_CODE[self._numbers("DLC", offset) & 0xF]
        data = self._raw("DataBytes", offset)
        data = data.view(np.uint8).reshape(len(data), -1)[:, :MAX_LENGTH]
        if len(data) != len(lengths):
            raise ValueError(f"only {len(data)} of {len(lengths)} frames have data")
        longest = int(lengths.max(initial=0))
        if longest > data.shape[1]:
            raise ValueError(f"it has frames of {longest} bytes in fields of {data.shape[1]}")
        result["length"] = lengths
        result["data"][:, : data.shape[1]] = data


def _is_text(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "SUO"


def _text(values: NDArray[Any]) -> NDArray[np.str_]:
    texts = [value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value) for value in values]
    if max(map(len, texts), default=0) > CHANNEL_NAME:
        raise ValueError(f"'{max(texts, key=len)}' in its frames is longer than {CHANNEL_NAME} characters")
    return np.array(texts, np.str_)


def _whole(field: str, values: NDArray[Any]) -> NDArray[np.int64]:
    """Whole numbers that a field of a frame may hold. Raises `ValueError` for others."""
    if values.dtype.kind not in "buif" or values.ndim != 1:
        raise ValueError(f"the {field} of its frames is no number")
    if not np.all((values >= 0) & (values <= _LARGEST_NUMBER) & (np.rint(values) == values)):
        raise ValueError(f"the {field} of its frames is {values[0]:g} and the like")
    return values.astype(np.int64)
