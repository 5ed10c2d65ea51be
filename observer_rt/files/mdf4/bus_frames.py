"""The CAN frames of MDF4 files as records, read by asammdf; to be run apart, for damage crashes its C code.

ASAM's rules for bus logging: one record a frame, groups apart by data, error and remote frames. A field may be
virtual: not stored, but given by the number of the record through its conversion, which makes a constant of it.
asammdf drops what follows a record that it does not know, and what the headings do not count: the bytes are counted.
"""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from asammdf.blocks.v4_constants import (
    CHANNEL_TYPE_VLSD,
    FLAG_CG_PLAIN_BUS_EVENT,
    FLAG_CG_VLSD,
    VIRTUAL_TYPES,
)
from numpy.typing import NDArray

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_MASK, STANDARD_MASK, length_of
from observer_rt.files.canlog.can_log import NANOSECONDS
from observer_rt.files.mdf4.can_log import CHANNEL_NAME, DATA, MAX_LENGTH, RECORD
from observer_rt.files.mdf4.opening import opened, record_size, refuse_outside, stored_bytes, stored_records

ERROR, REMOTE = "CAN_ErrorFrame", "CAN_RemoteFrame"
EXTENDED_BIT = 31  # of identifiers, where a logger stores no IDE
LOCAL_TIME = 0x1  # of the flags of the start
RECORDS_AT_ONCE = 50_000
_LARGEST_NUMBER = 0xFFFF_FFFF
_LARGEST_TIME = np.iinfo(np.int64).max
_LENGTH_OF_CODE = np.array([length_of(code) for code in range(16)])


def is_log(path: Path) -> Iterator[bool]:
    """Whether a file holds CAN frames, or can be nothing but a log whose frames were lost; once."""
    with opened(path) as file:
        frames = [group for group in _groups(file, DATA) if group.channel_group.cycles_nr]
        is_of_bus = [_is_of_bus(group) for group in file.groups]
        others = [
            group
            for group, of_bus in zip(file.groups, is_of_bus, strict=True)
            if not of_bus and group.channel_group.cycles_nr and not group.channel_group.flags & FLAG_CG_VLSD
        ]
        yield bool(frames or (any(is_of_bus) and not others))


def frames(path: Path) -> Iterator[list[Any] | NDArray[np.void]]:
    """Numbers of data, error, remote and other frames, and remarks; then the data frames, of dtype `RECORD`.

    Frames of several groups are put in order of time; what steps back within one group stays as it is.
    """
    with opened(path) as file:
        groups = [
            _Frames(file, number)
            for number, group in enumerate(file.groups)
            if _holds(group, DATA) and group.channel_group.cycles_nr
        ]
        total = sum(int(group.channel_group.cycles_nr) for group in file.groups if _is_of_bus(group))
        data = sum(int(each.is_valid.sum()) for each in groups)
        error, remote = (
            sum(int(group.channel_group.cycles_nr) for group in _groups(file, kind))
            for kind in (ERROR, REMOTE)
        )
        yield [data, error, remote, total - data - error - remote, [*_contradictions(file, groups)]]
        owners = np.repeat(np.arange(len(groups)), [each.stamps.size for each in groups])
        times = [np.maximum.accumulate(each.stamps) for each in groups]
        owners = owners[np.argsort(np.concatenate([*times, np.empty(0, np.int64)]), kind="stable")]
        for first in range(0, owners.size, RECORDS_AT_ONCE):
            part = owners[first : first + RECORDS_AT_ONCE]
            records, is_valid = np.empty(part.size, RECORD), np.empty(part.size, np.bool_)
            for number in np.unique(part):
                records[part == number], is_valid[part == number] = groups[number].following(
                    int(np.count_nonzero(part == number))
                )
            yield records[is_valid]


def _holds(group: Any, kind: str) -> bool:
    return any(channel.name == kind for channel in group.channels)


def _groups(file: MDF, kind: str) -> list[Any]:
    """Groups for CAN frames of a kind."""
    return [group for group in file.groups if _holds(group, kind)]


def _is_of_bus(group: Any) -> bool:
    """Whether a group is for what happens on a bus, as it came."""
    is_plain = bool(group.channel_group.flags & FLAG_CG_PLAIN_BUS_EVENT)
    return is_plain or any(_holds(group, kind) for kind in (DATA, ERROR, REMOTE))


def _contradictions(file: MDF, groups: list["_Frames"]) -> Iterator[str]:
    """Contradictions between the records read and the bytes in the file."""
    uncounted = missing = 0
    for channel_group in groups:
        group = file.groups[channel_group.number]
        stored = stored_records(file, group)
        uncounted += max(0, stored - channel_group.stamps.size)
        missing += max(0, int(group.channel_group.cycles_nr) - stored)
    if uncounted:
        yield f"its heading leaves out {uncounted} frames that are in it: it may be damaged"
    if missing:
        yield f"its heading counts {missing} frames that are not in it: its end may be missing"
    mixed = {group.data_group.data_block_addr for group in file.groups if group.data_group.record_id_len}
    for address in mixed - {0}:
        members = [group for group in file.groups if group.data_group.data_block_addr == address]
        lost = stored_bytes(file, address) - sum(map(_sorted, members))
        if lost:
            yield f"{lost} of its bytes are not of whole records: its end is missing, or it is damaged"


def _sorted(group: Any) -> int:
    """Bytes that asammdf took for a group from data of several groups, ids and data of variable length included."""
    id_size = int(group.data_group.record_id_len)
    size = sum(block.original_size for block in group.data_blocks)
    records = size // record_size(group)
    variable = [sum(block.original_size for block in blocks) for blocks in group.signal_data if blocks]
    return int(size + id_size * records + sum(variable) + id_size * records * len(variable))


def start_of(file: MDF) -> int:
    """Start in ns since 1970; local time, where that is stated, by the zone of this computer, as of logs of text."""
    start = int(file.header.abs_time)
    if not file.header.time_flags & LOCAL_TIME:
        return start
    seconds, fraction = divmod(start, NANOSECONDS)
    moment = datetime.fromtimestamp(seconds, UTC).replace(tzinfo=None)
    return int(moment.timestamp()) * NANOSECONDS + fraction


class _Frames:
    """The data frames of a group, by the names ASAM gives to their fields. stamps: (n,) ns; is_valid: (n,)."""

    def __init__(self, file: MDF, number: int) -> None:
        self.number = number
        self._file = file
        self._done = 0
        self._places = {
            channel.name.removeprefix(f"{DATA}."): place
            for place, channel in enumerate(file.groups[number].channels)
            if channel.name.startswith(DATA)
        }
        missing = [name for name in ("ID", "DataBytes") if name not in self._places]
        if missing or not {"DataLength", "DLC"} & self._places.keys():
            raise ValueError(f"its frames have no {(*missing, 'DataLength')[0]}")
        refuse_outside(file, number)
        start = start_of(file)
        everything = range(int(file.groups[number].channel_group.cycles_nr))
        identifiers = self._get("ID", everything)
        seconds = identifiers.timestamps.astype(np.float64)
        if not np.all((seconds >= -start / NANOSECONDS) & (seconds <= (_LARGEST_TIME - start) / NANOSECONDS)):
            raise ValueError("its frames have times before 1970, or after 2262")
        self.stamps: NDArray[np.int64] = np.rint(seconds * NANOSECONDS).astype(np.int64) + start
        self.is_valid = np.ones(self.stamps.size, np.bool_)
        for signal in (identifiers, self._get(DATA, everything)):
            if signal.invalidation_bits is not None:
                self.is_valid &= ~np.asarray(signal.invalidation_bits, np.bool_)

    def following(self, count: int) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
        """The next records, and which of them are valid."""
        rows = range(self._done, self._done + count)
        self._done += count
        identifiers = self._numbers("ID", rows)
        result = np.zeros(count, RECORD)
        result["stamp"] = self.stamps[rows.start : rows.stop]
        result["id"] = identifiers & EXTENDED_MASK
        is_extended = (identifiers >> EXTENDED_BIT > 0) | (result["id"] > STANDARD_MASK)
        result["is_extended"] = self._flags("IDE", rows, is_extended)
        self._read_data(rows, result)
        result["is_fd"] = self._flags("EDL", rows, result["length"] > CLASSIC_LENGTH)  # only FD carries more
        result["bit_rate_switch"] = self._flags("BRS", rows, False)
        result["error_state"] = self._flags("ESI", rows, False)
        result["channel"] = self._channels(rows)
        result["is_sent"] = self._are_sent(rows)
        return result, self.is_valid[rows.start : rows.stop]

    def _get(self, field: str, rows: range, **further: Any) -> Any:
        return self._file.get(
            group=self.number,
            index=self._places[field],
            record_offset=rows.start,
            record_count=len(rows),
            raw=True,
            ignore_invalidation_bits=True,
            **further,
        )

    def _raw(self, field: str, rows: range) -> NDArray[Any]:
        samples: NDArray[Any]
        samples, _ = self._get(field, rows, samples_only=True)
        return samples

    def _values(self, field: str, rows: range, keeps_text: bool = False) -> NDArray[Any]:
        """A field after its conversion; text for a number only where nothing is stored, or `keeps_text`."""
        raw = self._raw(field, rows)
        channel = self._file.groups[self.number].channels[self._places[field]]
        if channel.conversion is None:
            return raw
        is_virtual = channel.channel_type in VIRTUAL_TYPES
        values: NDArray[Any] = channel.conversion.convert(
            raw, ignore_value2text_conversions=not (is_virtual or keeps_text)
        )
        return values

    def _numbers(self, field: str, rows: range) -> NDArray[np.int64]:
        return _whole_numbers(field, self._values(field, rows))

    def _flags(self, field: str, rows: range, default: NDArray[Any] | bool) -> NDArray[np.bool_]:
        return np.asarray(self._numbers(field, rows) if field in self._places else default).astype(np.bool_)

    def _channels(self, rows: range) -> NDArray[np.str_]:
        if "BusChannel" not in self._places:
            return np.array("1")
        values = self._values("BusChannel", rows)
        return _text(values) if _is_text(values) else _whole_numbers("BusChannel", values).astype(np.str_)

    def _are_sent(self, rows: range) -> NDArray[np.bool_]:
        if "Dir" not in self._places:
            return np.array(False)
        values = self._values("Dir", rows, keeps_text=True)
        if _is_text(values):
            return np.array([text.strip().lower() == "tx" for text in _text(values).tolist()], np.bool_)
        return _whole_numbers("Dir", values).astype(np.bool_)

    def _read_data(self, rows: range, result: NDArray[np.void]) -> None:
        if "DataLength" in self._places:
            lengths = self._numbers("DataLength", rows)
        else:
            lengths = _LENGTH_OF_CODE[self._numbers("DLC", rows) & 0xF]
        data = self._raw("DataBytes", rows)
        data = data.view(np.uint8).reshape(len(data), -1)[:, :MAX_LENGTH]
        if len(data) != len(lengths):
            raise ValueError(f"only {len(data)} of {len(lengths)} frames have data")
        longest = int(lengths.max(initial=0))
        if longest > data.shape[1]:
            raise ValueError(f"it has frames of {longest} bytes in fields of {data.shape[1]}")
        channel = self._file.groups[self.number].channels[self._places["DataBytes"]]
        is_variable = channel.channel_type == CHANNEL_TYPE_VLSD
        if is_variable and np.any(data[np.arange(data.shape[1]) >= lengths[:, np.newaxis]]):  # other records
            raise ValueError("the data of one of its frames are longer than the frame")
        result["length"] = lengths
        result["data"][:, : data.shape[1]] = data


def _is_text(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "SUO"


def _text(values: NDArray[Any]) -> NDArray[np.str_]:
    texts = [value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value) for value in values]
    if max(map(len, texts), default=0) > CHANNEL_NAME:
        raise ValueError(f"'{max(texts, key=len)}' in its frames is longer than {CHANNEL_NAME} characters")
    return np.array(texts, np.str_)


def _whole_numbers(field: str, values: NDArray[Any]) -> NDArray[np.int64]:
    """Whole numbers that a field of a frame may hold. Raises `ValueError` for others."""
    if values.dtype.kind not in "buif" or values.ndim != 1:
        raise ValueError(f"the {field} of its frames is no number")
    if not np.all((values >= 0) & (values <= _LARGEST_NUMBER) & (np.rint(values) == values)):
        raise ValueError(f"the {field} of its frames is {values[0]:g} and the like")
    return values.astype(np.int64)
