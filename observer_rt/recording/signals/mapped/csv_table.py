"""CSV in any dialect, read by pandas, which is there with asammdf: fast, in parts, with decimal commas and quotes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.recording import RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.mapped.calendar import Calendar
from observer_rt.recording.signals.mapped.cells import MISSING, is_missing, is_number
from observer_rt.recording.signals.mapped.dialect import find_dialect
from observer_rt.recording.signals.mapped.table import TIME, Part, Table
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE

_TAIL = 1 << 14  # bytes, in which the last line is
NUMBERS = "write numbers; leave the cell empty where a value is not available"


class CsvTable(Table):
    """Columns by their names, in one line of names; the lines from the first number on."""

    def __init__(self, path: Path, config: RecordingConfig) -> None:
        super().__init__(path, config)
        columns = self.mapped_columns()
        self._dialect = dialect = find_dialect(
            path, config, {name: each.name for name, each in columns.items()}
        )
        self.layout = dialect.as_text()
        self.columns = dict(zip(dialect.names, dialect.units, strict=True))
        self.units = {name: unit for name, place in dialect.mapped.items() if (unit := dialect.units[place])}
        self.rasters = (tuple(name for name in columns if name != TIME),)
        self._origin = 0  # ns, of a calendar: its first stamp
        if dialect.calendar is not None:
            self._origin = self._first_stamp(dialect.calendar)
            self.units[TIME] = "s"
            self.layout += f"; {dialect.calendar.as_text(self._origin)}"
        self._is_cut = self._ends_too_soon()
        if self._is_cut:
            self.notes.append(f"{path}: its last line is not complete and is left out")

    def parts(self, raster: int) -> Iterator[Part]:
        """Blocks of rows."""
        import pandas  # slow to import

        dialect = self._dialect
        places = sorted(set(dialect.mapped.values()))
        text = [dialect.mapped[TIME]] if dialect.calendar is not None else []
        try:
            with pandas.read_csv(
                self.path,
                sep=r"\s+" if dialect.separator == " " else dialect.separator,
                decimal=dialect.decimal,
                comment=dialect.comment,
                header=None,
                names=range(len(dialect.names)),
                index_col=False,
                skiprows=dialect.first_row,
                skip_blank_lines=True,
                usecols=places,
                dtype={place: str if place in text else np.float64 for place in places},
                na_values=sorted(MISSING | {text.upper() for text in MISSING}),
                encoding=dialect.encoding,
                encoding_errors="replace",
                skipinitialspace=True,
                chunksize=SAMPLES_AT_ONCE,
            ) as blocks:
                held = None
                for block in blocks:
                    if held is not None:
                        yield self._part(held)
                    held = block
                if held is not None and len(held) > self._is_cut:
                    yield self._part(held[:-1] if self._is_cut else held)
        except pandas.errors.EmptyDataError:
            return
        except (ValueError, OverflowError) as error:  # ParserError is one
            self._refuse_line(error)

    def place(self, row: int, raster: int) -> str:
        """By its line."""
        for index, (number, _) in enumerate(self._rows()):
            if index == row:
                return f"{self.path}, line {number}"
        return str(self.path)

    def _part(self, block: Any) -> Part:
        """Rows of pandas as arrays."""
        mapped, calendar = self._dialect.mapped, self._dialect.calendar
        signals = {name: block[place].to_numpy(np.float64) for name, place in self._dialect.numbers.items()}
        if calendar is None:
            return Part(signals.pop(TIME), signals)
        stamps = block[mapped[TIME]]
        time = calendar.seconds(stamps, self._origin)
        wrong = np.flatnonzero(np.isnan(time) & stamps.notna().to_numpy())
        if wrong.size:
            raise UserError(
                self.place(int(block.index[wrong[0]]), 0),
                f"column {self._dialect.names[mapped[TIME]]} (time): '{stamps.iloc[wrong[0]]}' is no stamp of the "
                f"calendar as {calendar.form}",
                "mend the line, or say how stamps are written: [recording.time] format in the bench file",
            )
        return Part(time, signals)

    def _first_stamp(self, calendar: Calendar) -> int:
        """In ns since 1970."""
        place = self._dialect.mapped[TIME]
        cells = (row[place] for _, row in self._rows() if place < len(row))
        return next((int(calendar.nanoseconds([cell])[0]) for cell in cells if not is_missing(cell)), 0)

    def _ends_too_soon(self) -> bool:
        """Whether the last line is shorter than it should be and has no line end: its writer was stopped."""
        with self.path.open("rb") as file:
            file.seek(max(0, self.path.stat().st_size - _TAIL))
            tail = file.read().decode(self._dialect.encoding, "replace")
        last = tail.splitlines()[-1:] if tail and not tail.endswith(("\n", "\r")) else []
        return any(len(self._dialect.cells(line)) <= max(self._dialect.mapped.values()) for line in last)

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Lines by their numbers as cells, without those that hold no row."""
        with self.path.open(encoding=self._dialect.encoding, errors="replace", newline="") as file:
            for number, line in enumerate(file, 1):
                if number > self._dialect.first_row and (cells := self._dialect.cells(line)):
                    yield number, cells

    def _refuse_line(self, error: Exception) -> None:
        """Raise the error of the first line that will not do."""
        dialect = self._dialect
        for number, cells in self._rows():
            for name, place in dialect.numbers.items():
                cell = cells[place] if place < len(cells) else ""
                if not is_number(cell, dialect.decimal):
                    raise UserError(
                        f"{self.path}, line {number}",
                        f"column {dialect.names[place]} ({name}): '{cell}' is not a number with decimal "
                        f"'{dialect.decimal}'",
                        NUMBERS,
                    )
            if len(cells) > len(dialect.names) and any(cell.strip() for cell in cells[len(dialect.names) :]):
                raise UserError(
                    f"{self.path}, line {number}",
                    f"{len(cells)} cells, but there are {len(dialect.names)} columns",
                    "mend the line, or delete it",
                )
        raise UserError(str(self.path), f"cannot be read: {error}", "mend it, or write it anew")
