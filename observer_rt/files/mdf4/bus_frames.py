"""The CAN frames of MDF4 files as records, read by asammdf; to be run apart, for damage crashes its C code.

By ASAM's rules for bus logging; a virtual field is a constant. asammdf drops what follows an unknown record, and
what the headings do not count: so the bytes are counted.
"""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from asammdf.blocks.v4_constants import CHANNEL_TYPE_VLSD, FLAG_CG_PLAIN_BUS_EVENT, FLAG_CG_VLSD, VIRTUAL_TYPES
from numpy.typing import NDArray

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_MASK, STANDARD_MASK, length_of
from observer_rt.files.mdf4.can_log import CHANNEL_NAME, MAX_LENGTH, RECORD
from observer_rt.files.mdf4.opening import open_mdf, record_size, refuse_outside, stored_bytes, stored_records
from observer_rt.files.mdf4.reader_process import Answer
from observer_rt.foundation.units import NANOSECONDS, Bools, Ints, Structs

DATA, ERROR, REMOTE = "CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame"
EXTENDED_BIT = 31  # of identifiers, where a logger stores no IDE
LOCAL_TIME = 0x1  # of the flags of the start
RECORDS_AT_ONCE = 50_000
_LARGEST_NUMBER = 0xFFFF_FFFF
_LARGEST_TIME = np.iinfo(np.int64).max
_LENGTH_OF_CODE = np.array([length_of(code) for code in range(16)])


def is_log(path: Path) -> Iterator[Answer]:
    """Whether a file holds CAN frames, or can be nothing but a log whose frames were lost; once."""
    with open_mdf(path) as file:
        full = [group for group in file.groups if group.channel_group.cycles_nr]
        others = [group for group in full if not (_is_of_bus(group) or group.channel_group.flags & FLAG_CG_VLSD)]
        yield any(_holds(group, DATA) for group in full) or (any(map(_is_of_bus, file.groups)) and not others), {}


def frames(path: Path) -> Iterator[Answer]:
    """Numbers of data, error, remote and other frames, and remarks; and data frames, of dtype `RECORD`; in parts.

    Frames of several groups are put in order of time; what steps back within one group stays as it is.
    """
    with open_mdf(path) as file:
        numbers = [n for n, group in enumerate(file.groups) if _holds(group, DATA) and group.channel_group.cycles_nr]
        groups = [_Frames(file, number) for number in numbers]
        total, error, remote = (
            sum(int(group.channel_group.cycles_nr) for group in file.groups if is_counted(group))
            for is_counted in (_is_of_bus, lambda group: _holds(group, ERROR), lambda group: _holds(group, REMOTE))
        )
        data = sum(int(group.is_valid.sum()) for group in groups)
        remarks = [*_contradictions(file, groups)]
        if not data:
            remarks.append("it is a CAN log without a data frame: nothing was recorded, or it is damaged")
        totals = [data, error, remote, total - data - error - remote, remarks]
        owners = np.repeat(np.arange(len(groups)), [group.stamps.size for group in groups])
        times = [np.maximum.accumulate(group.stamps) for group in groups]
        owners = owners[np.argsort(np.concatenate([*times, np.empty(0, np.int64)]), kind="stable")]
        yield totals, {"records": np.empty(0, RECORD)}
        for first in range(0, owners.size, RECORDS_AT_ONCE):
            part = owners[first : first + RECORDS_AT_ONCE]
            records, is_valid = np.empty(part.size, RECORD), np.empty(part.size, np.bool_)
            for number in np.unique(part):
                rows = part == number
                records[rows], is_valid[rows] = groups[number].following(int(np.count_nonzero(rows)))
            yield totals, {"records": records[is_valid]}


def _holds(group: Any, kind: str) -> bool:
    return any(channel.name == kind for channel in group.channels)


def _is_of_bus(group: Any) -> bool:
    is_plain = bool(group.channel_group.flags & FLAG_CG_PLAIN_BUS_EVENT)
    return is_plain or any(_holds(group, kind) for kind in (DATA, ERROR, REMOTE))


def _contradictions(file: MDF, groups: list["_Frames"]) -> Iterator[str]:
    """Contradictions between the records read and the bytes in the file."""
    uncounted = missing = 0
    for of_group in groups:
        stored = stored_records(file, of_group.group)
        uncounted += max(0, stored - of_group.stamps.size)
        missing += max(0, int(of_group.group.channel_group.cycles_nr) - stored)
    if uncounted:
        yield f"its heading leaves out {uncounted} frames that are in it: it may be damaged"
    if missing:
        yield f"its heading counts {missing} frames that are not in it: its end may be missing"
    mixed = {group.data_group.data_block_addr for group in file.groups if group.data_group.record_id_len}
    for address in mixed - {0}:
        members = [group for group in file.groups if group.data_group.data_block_addr == address]
        lost = stored_bytes(file, address) - sum(map(_sorted_bytes, members))
        if lost:
            yield f"{lost} of its bytes are not of whole records: its end is missing, or it is damaged"


def _sorted_bytes(group: Any) -> int:
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
        self.group = file.groups[number]
        self._file, self._number = file, number
        self._rows = range(int(self.group.channel_group.cycles_nr))
        self._places = {
            channel.name.removeprefix(f"{DATA}."): place
            for place, channel in enumerate(self.group.channels)
            if channel.name.startswith(DATA)
        }
        missing = [name for name in ("ID", "DataBytes") if name not in self._places]
        if missing or not {"DataLength", "DLC"} & self._places.keys():
            raise ValueError(f"its frames have no {(*missing, 'DataLength')[0]}")
        refuse_outside(file, number)
        start = start_of(file)
        identifiers = self._get("ID")
        seconds = identifiers.timestamps.astype(np.float64)
        if not np.all((seconds >= -start / NANOSECONDS) & (seconds <= (_LARGEST_TIME - start) / NANOSECONDS)):
            raise ValueError("its frames have times before 1970, or after 2262")
        self.stamps: Ints = np.rint(seconds * NANOSECONDS).astype(np.int64) + start
        self.is_valid = np.ones(self.stamps.size, np.bool_)
        for signal in (identifiers, self._get(DATA)):
            if signal.invalidation_bits is not None:
                self.is_valid &= ~np.asarray(signal.invalidation_bits, np.bool_)
        self._rows = range(0)

    def following(self, count: int) -> tuple[Structs, Bools]:
        """The next records, and which of them are valid."""
        rows = self._rows = range(self._rows.stop, self._rows.stop + count)
        result = np.zeros(count, RECORD)
        identifiers = self._numbers("ID")
        result["stamp"] = self.stamps[rows.start : rows.stop]
        result["id"] = identifiers & EXTENDED_MASK
        is_extended = (identifiers >> EXTENDED_BIT > 0) | (result["id"] > STANDARD_MASK)
        result["is_extended"] = self._numbers("IDE", is_extended) != 0
        self._read_data(result)
        result["is_fd"] = self._numbers("EDL", result["length"] > CLASSIC_LENGTH) != 0  # only FD carries more
        result["bit_rate_switch"] = self._numbers("BRS", np.array(0)) != 0
        result["error_state"] = self._numbers("ESI", np.array(0)) != 0
        result["channel"] = self._numbers_or_text("BusChannel", np.array(1), is_number=True)
        direction = self._numbers_or_text("Dir", np.array(0), is_number=False)
        result["is_sent"] = (direction == "tx") | (direction == "1")
        return result, self.is_valid[rows.start : rows.stop]

    def _get(self, field: str, **further: Any) -> Any:
        return self._file.get(
            group=self._number,
            index=self._places[field],
            record_offset=self._rows.start,
            record_count=len(self._rows),
            raw=True,
            ignore_invalidation_bits=True,
            **further,
        )

    def _values(self, field: str, is_number: bool) -> NDArray[Any]:
        """A field after its conversion; is_number: text for a number only where nothing is stored."""
        raw: NDArray[Any] = self._get(field, samples_only=True)[0]
        channel = self.group.channels[self._places[field]]
        if channel.conversion is None:
            return raw
        keeps_text = channel.channel_type in VIRTUAL_TYPES or not is_number
        values: NDArray[Any] = channel.conversion.convert(raw, ignore_value2text_conversions=not keeps_text)
        return values

    def _numbers(self, field: str, default: NDArray[Any] | None = None) -> Ints:
        """Whole numbers that a field holds, the default without it. Raises `ValueError` for others."""
        if default is not None and field not in self._places:
            return default.astype(np.int64)
        return _whole_numbers(field, self._values(field, is_number=True))

    def _numbers_or_text(self, field: str, default: NDArray[Any], is_number: bool) -> NDArray[np.str_]:
        """Values of a field as text in small letters; a number becomes its digits."""
        if field not in self._places:
            return default.astype(np.str_)
        values = self._values(field, is_number)
        if values.dtype.kind not in "SUO":
            return _whole_numbers(field, values).astype(np.str_)
        texts = [value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value) for value in values]
        if max(map(len, texts), default=0) > CHANNEL_NAME:
            raise ValueError(f"'{max(texts, key=len)}' in its frames is longer than {CHANNEL_NAME} characters")
        return np.array([text.strip().lower() for text in texts], np.str_)

    def _read_data(self, result: Structs) -> None:
        if "DataLength" in self._places:
            lengths = self._numbers("DataLength")
        else:
            lengths = _LENGTH_OF_CODE[self._numbers("DLC") & 0xF]
        data = self._get("DataBytes", samples_only=True)[0]
        data = data.view(np.uint8).reshape(len(data), -1)[:, :MAX_LENGTH]
        if len(data) != len(lengths):
            raise ValueError(f"only {len(data)} of {len(lengths)} frames have data")
        longest = int(lengths.max(initial=0))
        if longest > data.shape[1]:
            raise ValueError(f"it has frames of {longest} bytes in fields of {data.shape[1]}")
        is_variable = self.group.channels[self._places["DataBytes"]].channel_type == CHANNEL_TYPE_VLSD
        if is_variable and np.any(data[np.arange(data.shape[1]) >= lengths[:, np.newaxis]]):  # other records
            raise ValueError("the data of one of its frames are longer than the frame")
        result["length"] = lengths
        result["data"][:, : data.shape[1]] = data


def _whole_numbers(field: str, values: NDArray[Any]) -> Ints:
    """Whole numbers that a field of a frame may hold. Raises `ValueError` for others."""
    if values.dtype.kind not in "buif" or values.ndim != 1:
        raise ValueError(f"the {field} of its frames is no number")
    if not np.all((values >= 0) & (values <= _LARGEST_NUMBER) & (np.rint(values) == values)):
        raise ValueError(f"the {field} of its frames is {values[0]:g} and the like")
    return values.astype(np.int64)
