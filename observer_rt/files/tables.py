"""Recordings from tables in memory, pandas DataFrames and arrays by name, mapped as those of files are."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from observer_rt.config.injector import ColumnConfig, RecordingConfig
from observer_rt.config.toml_file import validated
from observer_rt.files.signals.mapped_signals import MappedSignals
from observer_rt.files.signals.naming import in_words, layout_of, name_and_unit
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE, SignalStream
from observer_rt.files.signals.table import LARGEST, TIME, Heading, Table, TablePart, Values, present
from observer_rt.files.signals.time_axis import seconds_since
from observer_rt.foundation.errors import UserError


def framed(table: Any) -> pd.DataFrame:
    """A DataFrame, an index of floats or moments as its first column, or arrays by name as one.

    Raises `UserError` for anything else.
    """
    if isinstance(table, Mapping):
        try:
            return pd.DataFrame(dict(table))
        except ValueError as error:
            raise UserError("table", str(error), "give one value for each sample: shape (n,)") from None
    if not isinstance(table, pd.DataFrame):
        raise UserError(
            "table", f"is a {type(table).__name__}", "give a pandas DataFrame, or arrays by name in a dict"
        )
    if table.columns.has_duplicates:
        raise UserError("table", "several of its columns have one name", "give each a name of its own")
    return (
        table.rename_axis(table.index.name or TIME).reset_index()
        if table.index.dtype.kind in "fmM"
        else table
    )


def headings_of(frame: pd.DataFrame) -> list[Heading]:
    """Headings of the columns; units in names as `p_Rail [bar]`, or in `attrs["unit"]`."""
    headings = []
    for heading in frame.columns:
        name, unit = name_and_unit(str(heading))
        stated = str(frame[heading].attrs.get("unit", unit))
        headings.append(Heading(name, stated, None, frame[heading].dtype.kind in "mM"))
    return headings


class HeldTable(Table):
    """Columns of a DataFrame."""

    def __init__(self, name: str, config: RecordingConfig, frame: pd.DataFrame) -> None:
        super().__init__(Path(name), config)
        headings = headings_of(frame)
        names = [each.name for each in headings]
        wanted = {
            signal: column.model_copy(update={"column": names[column.column - 1]})
            if isinstance(column.column, int) and column.column <= len(names)
            else column
            for signal, column in self._wanted().items()
        }
        self.mapped: dict[str, ColumnConfig] = present(self.path, wanted, names, False)
        self.columns = {each.name: each.unit for each in headings}
        places = {signal: names.index(column.name) for signal, column in self.mapped.items()}
        self.units = {
            signal: "s" if headings[at].is_calendar else headings[at].unit for signal, at in places.items()
        }
        self._values = {signal: self._numbers(signal, frame.iloc[:, at]) for signal, at in places.items()}
        self.rasters = (tuple(signal for signal in self.mapped if signal != TIME),)
        self.layout = f"a table in memory, {len(names)} columns"

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Slices of the columns."""
        for first in range(0, len(self._values["rail_pressure"]), SAMPLES_AT_ONCE):
            rows = slice(first, first + SAMPLES_AT_ONCE)
            yield self._part({name: values[rows] for name, values in self._values.items()}, first)

    def location(self, row: int, raster: int) -> str:
        """Place of a row: its number, from 1."""
        return f"{self.path}, row {row + 1} of numbers"

    def _numbers(self, name: str, column: "pd.Series[Any]") -> Values:
        """Values as numbers; moments as seconds from the first."""
        location, kind = f"{self.path}, {self.label(name)}", column.dtype.kind
        if kind in "mM":
            if getattr(column.dtype, "tz", None) is not None:
                column = column.dt.tz_convert(None)
            moments = column.to_numpy(f"{kind}8[ns]").astype(np.int64)
            available = column.notna().to_numpy()
            return seconds_since(int(moments[available][0]) if available.any() else 0, moments)
        if kind not in "biuf":
            raise UserError(location, f"holds {column.dtype}, no numbers", "convert it by pandas.to_numeric")
        numbers: Values = column.to_numpy(np.float64, na_value=np.nan)
        beyond = np.flatnonzero(np.isfinite(numbers) & (np.abs(numbers) > LARGEST))
        if beyond.size:
            raise UserError(
                location, f"value {beyond[0] + 1} is {numbers[beyond[0]]:g}", "leave it out, or make it NaN"
            )
        return numbers


def signals_of(
    table: Any, layout: RecordingConfig | Mapping[str, Any] | None = None, name: str = "table"
) -> SignalStream:
    """Signals of a table in memory [SI], with a survey of odd values.

    table: pandas DataFrame, or arrays (n,) by name in a dict; units in brackets or at the end of names,
    `p_Rail [bar]`, `lift_um`; an index of moments or floats is the time. layout: what `[recording]` of a bench file
    says, None: what names and units say; with `rate_hz` no time is needed. name: in messages.
    Raises `UserError` with the layout to state where names and units do not say which column is which.
    """
    frame, notes = framed(table), list[str]()
    if layout is None:
        layout = layout_of(name, headings_of(frame))
        notes = [f"{name}: {in_words(layout)}"]
    elif not isinstance(layout, RecordingConfig):
        layout = validated(
            RecordingConfig, layout, lambda *keys: f"{name}, layout {'.'.join(map(str, keys))}", "bench"
        )
    stream = MappedSignals(HeldTable(name, layout, frame), 0.0)
    stream.notes = (*notes, *stream.notes)
    return stream
