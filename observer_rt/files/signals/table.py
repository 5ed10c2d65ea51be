"""A file as its mapping sees it, MDF4 or Parquet: columns with names and units, on one time axis or several."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter

from observer_rt.config.injector import ColumnConfig, RecordingConfig
from observer_rt.files.checksum import refuse_damaged
from observer_rt.files.mdf4.blocks import crash_told, mdf4_apart
from observer_rt.files.mdf4.records import count_records
from observer_rt.files.signals.column import Column, column_of
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.foundation.errors import UserError, hint
from observer_rt.foundation.sandbox import WorkerError, checked

TIME = "time"
LARGEST = 1e30  # no measurement, but what can be written in any unit
OPTIONAL = "injection_rate"  # which a file in our own layout may have or not
Values = NDArray[np.float64]

FILE = "observer_rt.files.signals.mdf4_channels"  # what touches the file runs apart

INSTALL = "pip install 'observer-rt[parquet]'"
READABLE = "give a complete Parquet file"

_FIRST_PAGE = 4  # bytes: the magic number
# of Thrift's compact protocol: type of a field, number of the checksum's in a page header
_I32, _CHECKSUM = 5, 4


@dataclass(frozen=True, eq=False)
class TablePart:
    """Rows that follow one another: time and signals by name as printed in the file, each (n,)."""

    time: Values
    signals: Mapping[str, Values]


Place = tuple[int, int]
"""Group and index of a channel of an MDF4 file."""


class FoundChannels(NamedTuple):
    """Places and units of the mapped channels of an MDF4 file, units of all channels; what is odd about the file."""

    places: dict[str, Place]
    units: dict[str, str]
    columns: dict[str, str]
    remarks: tuple[str, ...]


_NAMES = TypeAdapter(list[str])
_FOUND = TypeAdapter(FoundChannels)
_PART = TypeAdapter(tuple[np.ndarray, dict[str, np.ndarray]], config=ConfigDict(arbitrary_types_allowed=True))


class Table(ABC):
    """The mapped columns of a file.

    word: what a column is called; brings_time: the file's own time, in seconds, instead of a column that is mapped.
    Raises `UserError` for a file that lacks a column or cannot be read.
    """

    word: ClassVar[str] = "column"
    brings_time: bool = False

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        """is_own: `config` is our own layout, which the file is in to the letter."""
        self.path = path
        self.config = config
        self.is_own = is_own
        self.is_text = False
        """Whether numbers are decimal, to be converted to the value of their printed digits."""
        self.layout = ""
        """Layout of the file in a few words."""
        self.columns: Mapping[str, str] = {}
        """Units, empty where there is none, by the names of all columns."""
        self.mapped: dict[str, ColumnConfig] = {}
        """Columns of the file that are mapped, by signal and `time`."""
        self.units: dict[str, str] = {}
        """Units of the mapped columns in the file; left out where it states none."""
        self.rasters: tuple[tuple[str, ...], ...] = ()
        """Names of the mapped signals by time axis."""
        self.notes: list[str] = []
        self.origin = 0.0
        """Moment that times are counted from [s since 1970], where stamps of a calendar say it."""

    @abstractmethod
    def parts(self, raster: int) -> Iterator[TablePart]:
        """The rows of a time axis in order, read anew."""

    @abstractmethod
    def place(self, row: int, raster: int) -> str:
        """A zero-based row, as a user finds it."""

    def _wanted(self) -> dict[str, ColumnConfig]:
        """Columns that are mapped of a file whose time is a column, or none where the rate is stated."""
        if self.config.time is not None:
            return {TIME: self.config.time, **dict(self.config.signals)}
        if self.config.rate_hz is None:
            raise UserError(
                f"{self.path}: time",
                "no column is named for it",
                'say which in the bench file: [recording.time] column = "...", or how many rows are a second: '
                "[recording] rate_hz = 100e3",
            )
        return dict(self.config.signals)

    def _part(self, columns: dict[str, Values], row: int) -> TablePart:
        """Columns by signal, from a row on; without a time they follow each other at the rate stated."""
        if TIME in columns:
            return TablePart(columns.pop(TIME), columns)
        assert self.config.rate_hz is not None
        return TablePart((row + np.arange(len(next(iter(columns.values()))))) / self.config.rate_hz, columns)

    def label(self, name: str) -> str:
        """A mapped column, as a user finds it."""
        column = self.mapped[name].name
        return f"{self.word} {column if column.startswith(name) else f'{column} ({name})'}"


class FileTable(Table):
    """A table that is read in parts from its file, each time anew."""

    @staticmethod
    @abstractmethod
    def names(path: Path) -> Collection[str]:
        """Names of the columns, of a file in our own layout all."""

    @staticmethod
    @abstractmethod
    def preview(path: Path, most: int) -> Sequence[Column]:
        """Columns of a file that no mapping describes: about their first `most` values."""


def present(
    path: Path, wanted: Mapping[str, ColumnConfig], there: Collection[str], is_own: bool, word: str = "column"
) -> dict[str, ColumnConfig]:
    """The columns wanted that a file has. Raises `UserError` where one is missing that it must have."""
    found = {}
    for name, column in wanted.items():
        if column.name in there:
            found[name] = column
        elif not (is_own and name == OPTIONAL):
            raise UserError(
                str(path),
                f"{word} '{column.name}' is missing{hint(column.name, there)}",
                f"name the {word}s {', '.join(each.name for each in wanted.values())}, or say in [recording] of a "
                f"bench file which is which: it has {', '.join(list(there)[:40])}",
            )
    return found


class Mdf4Table(FileTable):
    """Channels by their names; time is that of their groups, in seconds."""

    word = "channel"
    brings_time = True

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        super().__init__(path, config, is_own)
        if config.time is not None:
            self.notes.append(f"{path}: [recording.time] is passed over, MDF4 channels have their own time")
        self._counted = count_records(path).as_json
        wanted = dict(config.signals)
        stated = {name: column.model_dump() for name, column in wanted.items()}
        begun = mdf4_apart(FILE, "found_and_parts", path, stated, is_own, self._counted, SAMPLES_AT_ONCE)
        with crash_told(path):
            found = checked(_FOUND, next(begun, None))
        self._begun: Iterator[Any] | None = begun
        self.notes += [f"{path}: {remark}" for remark in found.remarks]
        self._places = {name: place for name, place in found.places.items() if name in wanted}
        self.mapped = {name: wanted[name] for name in self._places}
        self.units, self.columns = found.units, found.columns
        self._groups = sorted({group for group, _ in self._places.values()})
        self.rasters = tuple(
            tuple(name for name, (group, _) in self._places.items() if group == wanted)
            for wanted in self._groups
        )
        groups = ", ".join(map(str, self._groups))
        self.layout = f"MDF4, channels in group{'s' * (len(self._groups) > 1)} {groups}"

    @staticmethod
    def names(path: Path) -> Collection[str]:
        """Names of the channels."""
        with crash_told(path):
            return checked(_NAMES, next(mdf4_apart(FILE, "names", path), None))

    @staticmethod
    def preview(path: Path, most: int) -> Sequence[Column]:
        """Channels of numbers, each with its group."""
        with crash_told(path):
            return [column_of(each) for each in mdf4_apart(FILE, "preview", path, most)]

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Parts of a group; those of the first one are already on their way when they are asked for first."""
        if raster == 0 and self._begun is not None:
            coming, self._begun = self._begun, None
        else:
            group = self._groups[raster]
            coming = mdf4_apart(FILE, "parts", self.path, group, self._places, self._counted, SAMPLES_AT_ONCE)
        for part in coming:
            with crash_told(self.path):
                time, signals = checked(_PART, part)
                if any(
                    each.dtype != np.float64 or each.shape != (time.size,)
                    for each in (time, *signals.values())
                ):
                    raise WorkerError("its reader gave arrays of several lengths or types")
            yield TablePart(time, signals)

    def place(self, row: int, raster: int) -> str:
        """Place of a row: its number in the group."""
        return f"{self.path}, group {self._groups[raster]}, sample {row}"


class ParquetTable(FileTable):
    """Columns by their names; units from the fields' metadata `unit`. Null is "not available".

    A column of calendar stamps is in seconds.
    """

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        super().__init__(path, config, is_own)
        wanted = self._wanted()
        self.notes += [f"{path}: {remark}" for remark in refuse_damaged(path)]
        with _opened(path) as file:
            schema = file.schema_arrow
            if not _has_page_checksums(path, file.metadata):
                self.notes.append(
                    f"{path}: its pages have no checksums, so that damage may pass unseen: write it with "
                    "write_page_checksum=True"
                )
        self.mapped = present(path, wanted, schema.names, is_own)
        self.columns = {field.name: _unit(field.metadata) for field in schema}
        self.units = {name: unit for name, each in self.mapped.items() if (unit := self.columns[each.name])}
        if TIME in self.mapped and _is_calendar(schema.field(self.mapped[TIME].name).type):
            self.units[TIME] = "s"
        self.rasters = (tuple(name for name in self.mapped if name != TIME),)
        self.layout = f"Parquet, {len(schema.names)} columns"

    @staticmethod
    def names(path: Path) -> Collection[str]:
        """Names of the columns."""
        with _opened(path) as file:
            return list(file.schema_arrow.names)

    @staticmethod
    def preview(path: Path, most: int) -> Sequence[Column]:
        """Columns of numbers and moments."""
        with _opened(path) as file:
            kept = [each for each in file.schema_arrow if _is_calendar(each.type) or _is_number(each.type)]
            parts: dict[str, list[Values]] = {each.name: [] for each in kept}
            rows = 0
            for batch in file.iter_batches(SAMPLES_AT_ONCE, columns=list(parts), use_threads=False):
                for name, values in parts.items():
                    values.append(_numbers(batch.column(name), f"{path}, column {name}"))
                if (rows := rows + batch.num_rows) >= most:
                    break
        units = {each.name: "s" if _is_calendar(each.type) else _unit(each.metadata) for each in kept}
        return [
            Column(each.name, np.concatenate(parts[each.name]), units[each.name])
            for each in kept
            if parts[each.name]
        ]

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Batches of rows."""
        names = list(dict.fromkeys(column.name for column in self.mapped.values()))
        row = 0
        with _opened(self.path) as file:
            # one thread: those of a pool would keep 25 MB, and are no faster for so few rows
            for batch in file.iter_batches(SAMPLES_AT_ONCE, columns=names, use_threads=False):
                columns = {
                    name: _numbers(batch.column(name), f"{self.path}, column {name}") for name in names
                }
                yield self._part({name: columns[each.name] for name, each in self.mapped.items()}, row)
                row += batch.num_rows

    def place(self, row: int, raster: int) -> str:
        """Place of a row in the file: its number."""
        return f"{self.path}, row {row}"


def _is_calendar(kind: Any) -> bool:
    return str(kind).startswith(("timestamp", "duration"))


def _is_number(kind: Any) -> bool:
    import pyarrow

    types = pyarrow.types
    return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind))


def _numbers(column: Any, place: str) -> Values:
    """An array of Arrow as doubles; stamps of a calendar as seconds. Raises `UserError` for what is none."""
    import pyarrow

    kind = column.type
    if _is_calendar(kind):
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        return _doubles(column.cast(pyarrow.int64())) * scale
    if not _is_number(kind):
        raise UserError(place, f"holds {kind}, no numbers", "map a column of numbers")
    return _doubles(column)


def _doubles(column: Any) -> Values:
    import pyarrow

    return np.array(column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False), np.float64)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A file to read. Raises `UserError` for a damaged one, and where pyarrow is not installed."""
    with path.open("rb"):  # whose errors are the usual ones; pyarrow reads its own files faster
        pass
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise UserError(str(path), "is read by pyarrow, which is missing", INSTALL) from None
    try:
        with (
            pyarrow.OSFile(str(path)) as opened,
            pyarrow.parquet.ParquetFile(opened, pre_buffer=False, page_checksum_verification=True) as file,
        ):
            yield file
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise UserError(str(path), f"a damaged Parquet file: {error}", READABLE) from None


def _has_page_checksums(path: Path, metadata: Any) -> bool:
    """Whether the first page of a Parquet file has one, or there is no page."""
    if not metadata.num_row_groups or not metadata.num_columns:
        return True
    with path.open("rb") as file:
        file.seek(
            _FIRST_PAGE
        )  # not where metadata say: pyarrow ends the process over the damaged ones of a column
        header = iter(file.read(64))
    field = 0
    for begin in header:  # the fields in order: type, two sizes, the checksum if there is one
        field += begin >> 4
        if begin & 0x0F != _I32 or field >= _CHECKSUM:
            return begin & 0x0F == _I32 and field == _CHECKSUM
        while next(header, 0) & 0x80:  # the rest of its value
            pass
    return False


def _unit(metadata: dict[bytes, bytes] | None) -> str:
    return (metadata or {}).get(b"unit", b"").decode("utf-8", "replace").strip()
