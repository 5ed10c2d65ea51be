"""What a file is to its mapping: columns with names and units, on one time axis or several."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.recording import ColumnConfig, RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint

TIME = "time"
OPTIONAL = "injection_rate"  # which a file in our own layout may have or not
Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TablePart:
    """Rows that follow one another: time and signals by name as printed in the file, each (n,)."""

    time: Values
    signals: Mapping[str, Values]


class Table(ABC):
    """The mapped columns of a file.

    word: what a column is called; brings_time: the file's own time, in seconds, instead of a column that is mapped.
    Raises `UserError` for a file that lacks a column or cannot be read.
    """

    word: ClassVar[str] = "column"
    brings_time: ClassVar[bool] = False

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        """is_own: `config` is our own layout, which the file is in to the letter."""
        self.path = path
        self.config = config
        self.is_own = is_own
        self.is_text = False
        """Whether numbers are decimal, to be converted to what their printed digits say."""
        self.layout = ""
        """How the file is written, in a few words."""
        self.columns: Mapping[str, str] = {}
        """Units, empty where there is none, by the names of all columns."""
        self.mapped: dict[str, ColumnConfig] = {}
        """Those of the file that are mapped, by signal and `time`."""
        self.units: dict[str, str] = {}
        """As the file says them, of the mapped columns; left out where it does not."""
        self.rasters: tuple[tuple[str, ...], ...] = ()
        """Names of the mapped signals by time axis."""
        self.notes: list[str] = []

    @staticmethod
    @abstractmethod
    def names(path: Path) -> Collection[str]:
        """Of the columns, of a file in our own layout all."""

    @abstractmethod
    def parts(self, raster: int) -> Iterator[TablePart]:
        """The rows of a time axis in order, read anew."""

    @abstractmethod
    def place(self, row: int, raster: int) -> str:
        """A zero-based row, as a user finds it."""

    def _wanted(self) -> dict[str, ColumnConfig]:
        """What is mapped of a file whose time is a column."""
        if self.config.time is None:
            raise UserError(
                f"{self.path}: time",
                "no column is named for it",
                'say which in the bench file: [recording.time] column = "..."',
            )
        return {TIME: self.config.time, **dict(self.config.signals)}

    def label(self, name: str) -> str:
        """A mapped column, as a user finds it."""
        column = self.mapped[name].name
        return f"{self.word} {column if column.startswith(name) else f'{column} ({name})'}"


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
