"""What a file of any layout is to the mapping: columns with names and units, on one time axis or several."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.recording import ColumnConfig, RecordingConfig
from observer_rt.foundation.errors import UserError

TIME = "time"
Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part:
    """Rows that follow one another: time and signals by name as printed in the file, each (n,)."""

    time: Values
    signals: Mapping[str, Values]


class Table(ABC):
    """The mapped columns of a file.

    brings_time: the file's own time, in seconds, instead of a column that is mapped. Raises `UserError` for a file
    that lacks a column or cannot be read.
    """

    brings_time: ClassVar[bool] = False

    def __init__(self, path: Path, config: RecordingConfig) -> None:
        self.path = path
        self.config = config
        self.layout = ""
        """How the file is written, in a few words."""
        self.columns: Mapping[str, str] = {}
        """Units, empty where there is none, by the names of all columns."""
        self.units: dict[str, str] = {}
        """As the file says them, of the mapped signals and of `time`; left out where it does not."""
        self.rasters: tuple[tuple[str, ...], ...] = ()
        """Names of the mapped signals by time axis."""
        self.notes: list[str] = []

    def mapped_columns(self) -> dict[str, ColumnConfig]:
        """Of a file whose time is a column."""
        if self.config.time is None:
            raise UserError(
                f"{self.path}: time",
                "no column is named for it",
                'say which in the bench file: [recording.time] column = "..."',
            )
        return {TIME: self.config.time, **dict(self.config.signals)}

    @abstractmethod
    def parts(self, raster: int) -> Iterator[Part]:
        """The rows of a time axis in order, read anew."""

    @abstractmethod
    def place(self, row: int, raster: int) -> str:
        """A zero-based row, as a user finds it."""
