"""The CAN frames of MDF4 files as records, read by asammdf; to be run apart, for damage crashes its C code.

ASAM's rules for bus logging: one record a frame, groups apart by data, error and remote frames. A field may be
virtual: not stored, but given by the number of the record through its conversion, which makes a constant of it.
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
    MASTER_TYPES,
    VIRTUAL_TYPES,
)
from numpy.typing import NDArray

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_MASK, STANDARD_MASK, length_of
from observer_rt.files.canlog.can_log import NANOSECONDS
from observer_rt.files.mdf4.blocks import CountedRecords
from observer_rt.files.mdf4.can_log import CHANNEL_NAME, MAX_LENGTH, RECORD, Totals
from observer_rt.files.mdf4.opening import opened, refuse_outside

DATA, ERROR, REMOTE = KINDS = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame")
KNOWN_FIELDS = (
    *("ID", "IDE", "DLC", "DataLength", "DataBytes", "Dir", "BusChannel", "EDL", "BRS", "ESI"),
    *("SRR", "RTR", "R0", "R1", "CRC", "FrameDuration", "BitCount", "SingleWire", "WakeUp"),  # passed over
)
EXTENDED_BIT = 31  # of identifiers, where a logger stores no IDE
LOCAL_TIME = 0x1  # of the flags of the start
DAY = 24 * 3600 * NANOSECONDS
LONGEST_BEFORE = 7  # days from the start of a file to its first frame
EXACT = 1 << 53  # ns: more are rounded in a float64
ROUND_DIGITS = 6  # of the seconds in which a clock counts
RECORDS_AT_ONCE = 50_000
_LARGEST_NUMBER = 0xFFFF_FFFF
_LARGEST_TIME = np.iinfo(np.int64).max
_LENGTH_OF_CODE = np.array([length_of(code) for code in range(16)])


def is_log(path: Path) -> Iterator[bool]:
    """Whether a file holds CAN frames, or can be nothing but a log whose frames were lost; once."""
    with opened(path) as file:
        frames = [number for number in _groups(file, DATA) if _cycles(file, number)]
        buses = {number for number in range(len(file.groups)) if _is_of_bus(file, number)}
        others = [
            number
            for number, group in enumerate(file.groups)
            if number not in buses and _cycles(file, number) and not group.channel_group.flags & FLAG_CG_VLSD
        ]
        yield bool(frames or (buses and not others))


def records(path: Path, counted_json: str) -> Iterator[Totals | NDArray[np.void]]:
    """Totals of a file, then its data frames in arrays of dtype `RECORD`.

    Frames of several groups are put in order of time; what steps back within one group stays as it is. counted_json:
    `CountedRecords`, as they are in the file, whatever asammdf finds.
    """
    counted = CountedRecords.of_json(counted_json)
    with opened(path) as file:
        counts = {
            number: counted.readable(group.channel_group.address, _cycles(file, number))
            for number, group in enumerate(file.groups)
            if _is_of_bus(file, number)
        }
        fields = {number: _Fields(file, number) for number in _groups(file, DATA) if counts[number]}
        odd = dict.fromkeys(remark for each in fields.values() for remark in each.oddities())
        data, error, remote = (sum(counts[number] for number in _groups(file, kind)) for kind in KINDS)
        places = [file.groups[number].channel_group.address for number in _groups(file, DATA)]
        remarks = (*counted.remarks, *counted.contradictions(places, "frames"), *odd)
        yield Totals(data, error, remote, sum(counts.values()) - data - error - remote, remarks)
        yield from in_order_of_time([each.records(counts[number]) for number, each in fields.items()])


def _groups(file: MDF, kind: str) -> list[int]:
    """Numbers of the groups for CAN frames of a kind."""
    return [
        number
        for number, group in enumerate(file.groups)
        if any(channel.name == kind for channel in group.channels)
    ]


def _is_of_bus(file: MDF, number: int) -> bool:
    """Whether a group is for what happens on a bus, as it came."""
    group = file.groups[number]
    is_plain = bool(group.channel_group.flags & FLAG_CG_PLAIN_BUS_EVENT)
    return is_plain or any(channel.name in KINDS for channel in group.channels)


def _cycles(file: MDF, number: int) -> int:
    return int(file.groups[number].channel_group.cycles_nr)


def start_of(file: MDF) -> int:
    """Start in ns since 1970; local time, where that is stated, by the zone of this computer, as of logs of text."""
    start = int(file.header.abs_time)
    if not file.header.time_flags & LOCAL_TIME:
        return start
    seconds, rest = divmod(start, NANOSECONDS)
    moment = datetime.fromtimestamp(seconds, UTC).replace(tzinfo=None)
    return int(moment.timestamp()) * NANOSECONDS + rest


class _Fields:
    """The fields of the frames in a group, by the names ASAM gives them."""

    def __init__(self, file: MDF, group: int) -> None:
        self._file = file
        self._group = group
        self._start = start_of(file)
        self._places = {
            channel.name.removeprefix(f"{DATA}."): number
            for number, channel in enumerate(file.groups[group].channels)
            if channel.name.startswith(f"{DATA}.")
        }
        missing = [name for name in ("ID", "DataBytes") if name not in self._places]
        if missing or not {"DataLength", "DLC"} & self._places.keys():
            raise ValueError(f"its frames have no {(*missing, 'DataLength')[0]}")

    def records(self, count: int) -> Iterator[NDArray[np.void]]:
        """Records up to a number of them, some at once."""
        refuse_outside(self._file, self._group)
        for first in range(0, count, RECORDS_AT_ONCE):
            yield self._read(range(first, min(first + RECORDS_AT_ONCE, count)))

    def oddities(self) -> Iterator[str]:
        """Oddities of its fields, of when its frames begin and what its clock counts: a file has no checksum."""
        channels = self._file.groups[self._group].channels
        names = {each.name for each in channels if each.channel_type not in MASTER_TYPES} - {DATA}
        unknown = sorted(names - {f"{DATA}.{field}" for field in KNOWN_FIELDS})
        if unknown:
            yield f"its frames have fields that are not known here: {', '.join(map(ascii, unknown[:3]))}"
        refuse_outside(self._file, self._group)
        first = int(self._stamps(range(1))[0])
        days = (first - self._start) // DAY
        if self._start and days > LONGEST_BEFORE:
            yield f"its frames begin {days} days after its start: it may be damaged"
        if not self._start and first > EXACT:
            yield "its times count from 1970 in floating point: they are off by up to 0.5 us"
        master = self._file.masters_db.get(self._group)
        if master is None:
            return
        tick = getattr(channels[master].conversion, "a", 1.0)
        if float(f"{tick:.{ROUND_DIGITS}g}") != tick:
            yield f"its clock counts in {tick!r} s, which is no round number: it may be damaged"

    def _read(self, rows: range) -> NDArray[np.void]:
        identifiers = self._numbers("ID", rows)
        result = np.zeros(identifiers.size, RECORD)
        result["stamp"] = self._stamps(rows)
        result["id"] = identifiers & EXTENDED_MASK
        is_extended = (identifiers >> EXTENDED_BIT > 0) | (result["id"] > STANDARD_MASK)
        result["is_extended"] = self._flags("IDE", rows, is_extended)
        self._read_data(rows, result)
        result["is_fd"] = self._flags("EDL", rows, result["length"] > CLASSIC_LENGTH)  # only FD carries more
        result["bit_rate_switch"] = self._flags("BRS", rows, False)
        result["error_state"] = self._flags("ESI", rows, False)
        result["channel"] = self._channels(rows)
        result["is_sent"] = self._are_sent(rows)
        return result

    def _stamps(self, rows: range) -> NDArray[np.int64]:
        seconds = self._get("ID", rows).timestamps.astype(np.float64)
        latest = (_LARGEST_TIME - self._start) / NANOSECONDS
        if not np.all((seconds >= -self._start / NANOSECONDS) & (seconds <= latest)):
            raise ValueError("its frames have times before 1970, or after 2262")
        stamps: NDArray[np.int64] = np.rint(seconds * NANOSECONDS).astype(np.int64) + self._start
        return stamps

    def _get(self, field: str, rows: range, **further: Any) -> Any:
        return self._file.get(
            group=self._group,
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
        channel = self._file.groups[self._group].channels[self._places[field]]
        if channel.conversion is None:
            return raw
        is_virtual = channel.channel_type in VIRTUAL_TYPES
        values: NDArray[Any] = channel.conversion.convert(
            raw, ignore_value2text_conversions=not (is_virtual or keeps_text)
        )
        return values

    def _numbers(self, field: str, rows: range) -> NDArray[np.int64]:
        return _whole(field, self._values(field, rows))

    def _flags(self, field: str, rows: range, default: NDArray[Any] | bool) -> NDArray[np.bool_]:
        return np.asarray(self._numbers(field, rows) if field in self._places else default).astype(np.bool_)

    def _channels(self, rows: range) -> NDArray[np.str_]:
        if "BusChannel" not in self._places:
            return np.array("1")
        values = self._values("BusChannel", rows)
        return _text(values) if _is_text(values) else _whole("BusChannel", values).astype(np.str_)

    def _are_sent(self, rows: range) -> NDArray[np.bool_]:
        if "Dir" not in self._places:
            return np.array(False)
        values = self._values("Dir", rows, keeps_text=True)
        if _is_text(values):
            return np.array([text.strip().lower() == "tx" for text in _text(values).tolist()], np.bool_)
        return _whole("Dir", values).astype(np.bool_)

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
        channel = self._file.groups[self._group].channels[self._places["DataBytes"]]
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


def _whole(field: str, values: NDArray[Any]) -> NDArray[np.int64]:
    """Whole numbers that a field of a frame may hold. Raises `ValueError` for others."""
    if values.dtype.kind not in "buif" or values.ndim != 1:
        raise ValueError(f"the {field} of its frames is no number")
    if not np.all((values >= 0) & (values <= _LARGEST_NUMBER) & (np.rint(values) == values)):
        raise ValueError(f"the {field} of its frames is {values[0]:g} and the like")
    return values.astype(np.int64)


def in_order_of_time(groups: list[Iterator[NDArray[np.void]]]) -> Iterator[NDArray[np.void]]:
    """The records of all groups by time, those of each group in its own order."""
    waiting = [_WaitingRecords(records) for records in groups]
    while waiting := [each for each in waiting if each.fill()]:
        horizon = min(each.latest for each in waiting)
        parts = [each.taken_to(horizon) for each in waiting]
        times = np.concatenate([time for time, _ in parts])
        yield np.concatenate([part for _, part in parts])[np.argsort(times, kind="stable")]


class _WaitingRecords:
    """Records of one group that are not given on yet; their time is the latest up to each."""

    def __init__(self, coming: Iterator[NDArray[np.void]]) -> None:
        self._coming = coming
        self._records: NDArray[np.void] = np.empty(0, np.void)
        self._times: NDArray[np.int64] = np.empty(0, np.int64)
        self._before = np.iinfo(np.int64).min

    def fill(self) -> bool:
        """Take the next records where none are left; whether there are any."""
        while self._records.size == 0:
            following = next(self._coming, None)
            if following is None:
                return False
            self._records = following
            self._times = np.maximum(np.maximum.accumulate(following["stamp"]), self._before)
        return True

    @property
    def latest(self) -> int:
        return int(self._times[-1])

    def taken_to(self, horizon: int) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        count = int(np.searchsorted(self._times, horizon, side="right"))
        times, taken = self._times[:count], self._records[:count]
        if count:
            self._before = int(times[-1])
        self._times, self._records = self._times[count:], self._records[count:]
        return times, taken
