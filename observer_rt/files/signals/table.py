"""A file as its mapping sees it: columns with names and units, on one time axis or several; formats of such files."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from observer_rt.config.injector_sections import ColumnConfig, RecordingConfig
from observer_rt.files.signals.recording import is_needed
from observer_rt.foundation.errors import UserError, hint
from observer_rt.foundation.units import Floats

TIME = "time"
LARGEST = 1e30  # no measurement, but what can be written in any unit


class Heading(NamedTuple):
    """Heading of a column. unit: empty where none is stated; group: of MDF4."""

    name: str
    unit: str = ""
    group: int | None = None
    is_calendar: bool = False


class TablePart(NamedTuple):
    """Rows that follow one another: time and signals by name as printed in the file, each (n,)."""

    time: Floats
    signals: Mapping[str, Floats]

    def followed_by(self, part: "TablePart") -> "TablePart":
        """These rows, and those of a part that follows; `NO_ROWS` are followed by any."""
        before = self.signals or dict.fromkeys(part.signals, self.time)
        signals = {name: np.concatenate((before[name], values)) for name, values in part.signals.items()}
        return TablePart(np.concatenate((self.time, part.time)), signals)


NO_ROWS = TablePart(np.empty(0), {})


class Table(ABC):
    """Mapped columns of a file; brings_time: its own time [s]. Raises `UserError` without a column, or unreadable."""

    word: ClassVar[str] = "column"
    brings_time: bool = False

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        """is_own: `config` is our own layout, which the file is in to the letter."""
        self.path = path
        self.config = config
        self.is_own = is_own
        self.mapped_by = "as the bench file says"
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
        self.density: float | None = None
        """Density of the fuel [kg/m3], for rates of mass; None: not known."""
        self.notes: list[str] = []
        self.origin = 0.0
        """Moment that times are counted from [s since 1970], where stamps of a calendar say it."""

    @abstractmethod
    def parts(self, raster: int) -> Iterator[TablePart]:
        """The rows of a time axis in order, read anew."""

    @abstractmethod
    def location(self, row: int, raster: int) -> str:
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

    def _part(self, columns: dict[str, Floats], row: int) -> TablePart:
        """Without a time the rows follow each other at the rate stated."""
        if TIME in columns:
            return TablePart(columns.pop(TIME), columns)
        assert self.config.rate_hz is not None
        return TablePart((row + np.arange(len(next(iter(columns.values()))))) / self.config.rate_hz, columns)

    def label(self, name: str) -> str:
        """A mapped column, as a user finds it."""
        column = self.mapped[name].column
        return f"{self.word} {column if column.startswith(name) else f'{column} ({name})'}"


class FileTable(Table):
    """A table that is read in parts from its file, each time anew."""

    @staticmethod
    @abstractmethod
    def headings(path: Path) -> Sequence[Heading]:
        """Headings of the columns of numbers and moments."""

    @classmethod
    def names(cls, path: Path) -> Collection[str]:
        """Names of the columns, of a file in our own layout all."""
        return [heading.name for heading in cls.headings(path)]


def find_columns(
    path: Path, wanted: Mapping[str, ColumnConfig], names: Collection[str], is_own: bool, word: str = "column"
) -> dict[str, ColumnConfig]:
    """The columns wanted that a file has. Raises `UserError` where one is missing that it must have."""
    columns, energizing = {}, wanted.get("energizing")
    has_energizing = energizing is not None and energizing.column in names
    for name, column in wanted.items():
        if (count := list(names).count(column.column)) > 1:
            raise UserError(str(path), f"{word} '{column.column}' appears {count} times", "keep one")
        if column.column in names:
            columns[name] = column
        elif not is_own or is_needed(name, has_energizing):
            raise missing_column(str(path), column, names, word)
    return columns


def missing_column(location: str, column: ColumnConfig, names: Collection[str], word: str = "column") -> UserError:
    """The error for a column that a mapping names and a file does not have."""
    problem = f"{word} '{column.column}' is missing{hint(column.column, names)}"
    remedy = f"say in a bench's [recording] which {word} is which, in text also by number, as column = 2: it has "
    return UserError(location, problem, remedy + ", ".join([*names][:40]))


@dataclass(frozen=True)
class SignalFormat:
    """Kind of file with a recording's signals, by its suffix, in lower case with its dot.

    table: reads its files by any mapping; mapping: that of our own layout; is_written: or only read.
    """

    suffix: str
    table: type[FileTable]
    mapping: RecordingConfig
    is_written: bool = True

    def is_own(self, path: Path, other: RecordingConfig | None) -> bool:
        """Whether a file is in our own layout, and not in another one."""
        names = self.table.names(path)
        has_energizing = dict(self.mapping.signals)["energizing"].column in names
        needed = [column.column for name, column in self.mapping.signals if is_needed(name, has_energizing)]
        needed += [self.mapping.time.column] if self.mapping.time is not None else []
        is_in_another = other is not None and all(column.column in names for _, column in other.signals)
        return all(name in names for name in needed) and not is_in_another
