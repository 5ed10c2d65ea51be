"""Recordings from tables in memory, pandas DataFrames and arrays by name, mapped as tables in files are."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import time
from pathlib import Path
from typing import Any

import pandas as pd

from observer_rt.config.injector_sections import RecordingConfig
from observer_rt.config.toml_file import validated
from observer_rt.files.signals.arrow_table import ArrowTable, headings_of
from observer_rt.files.signals.csv_dialect import MISSING
from observer_rt.files.signals.mapped_signals import MappedSignals
from observer_rt.files.signals.naming import in_words, is_unit, layout_of, name_and_unit
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE, SignalStream
from observer_rt.files.signals.table import TIME
from observer_rt.files.signals.time_axis import calendar_of
from observer_rt.foundation.errors import UserError

_WITH_THOUSANDS = r"[+-]?\d{1,3}(?:[.,]\d{3})*"  # `999` and `1.002` in one column may be 999 and 1002


def _in_arrow(table: Any, name: str) -> Any:
    """A DataFrame, its index as first column of times, or arrays by name as a table of Arrow; else `UserError`."""
    import pyarrow

    if not isinstance(table, Mapping | pd.DataFrame):
        raise UserError(name, f"is a {type(table).__name__}", "give a pandas DataFrame, or arrays by name in a dict")
    try:
        frame = pd.DataFrame(dict(table)) if isinstance(table, Mapping) else table
        if frame.index.dtype.kind in "fmM":
            frame = frame.rename_axis(frame.index.name or TIME).reset_index()
        if frame.columns.has_duplicates:
            raise ValueError("several of its columns have one name")
        fields, columns = [], []
        for heading, column in frame.items():
            header, unit = name_and_unit(_one_line(heading))
            columns.append(pyarrow.array(_numbers(column), from_pandas=True))
            metadata = {"unit": str(column.attrs.get("unit", unit))}
            fields.append(pyarrow.field(header, columns[-1].type, metadata=metadata))
        return pyarrow.table(columns, pyarrow.schema(fields))
    except (ValueError, TypeError, AttributeError, pyarrow.ArrowException) as error:
        remedy = "give columns of numbers, each under a name of its own, one value for each sample: shape (n,)"
        raise UserError(name, str(error), remedy) from None


def _one_line(heading: Any) -> str:
    """A heading of one or several rows, as units may be in the last, as `name [unit]`."""
    if not isinstance(heading, tuple):
        return str(heading)
    *names, last = [str(part) for part in heading if part != "" and not str(part).startswith("Unnamed: ")]
    return " ".join([*names, f"[{bare}]" if names and is_unit(bare := last.strip("[]() ")) else last])


def _numbers(column: Any) -> Any:
    if column.dtype.kind != "O":
        return column
    text = column.astype(str).str.strip()
    is_missing = column.isna() | text.str.lower().isin(MISSING)
    if text[~is_missing].str.fullmatch(_WITH_THOUSANDS).all() and text.str.contains("[.,]").nunique() > 1:
        return text
    for sign in ".,":
        numbers = pd.to_numeric(text.str.replace(sign, "."), errors="coerce")
        if (numbers.notna() | is_missing).all():
            return numbers
    if (calendar := calendar_of(None, text)) is not None:
        return calendar.nanoseconds(text).astype("M8[ns]" if calendar.has_date else "m8[ns]")
    return column if all(isinstance(each, time) for each in column[~is_missing]) else text


class HeldTable(ArrowTable):
    """A table in memory."""

    def __init__(self, name: str, config: RecordingConfig, table: Any) -> None:
        self._table = table
        super().__init__(Path(name), config, table.schema)

    def _batches(self, names: Sequence[str]) -> Iterator[Any]:
        yield from self._table.select(list(names)).to_batches(SAMPLES_AT_ONCE)


def signals_of(
    table: Any,
    layout: RecordingConfig | Mapping[str, Any] | None = None,
    name: str = "table",
    density: float | None = None,
) -> SignalStream:
    """Signals of a table in memory [SI], with a survey of odd values.

    table: pandas DataFrame, or arrays (n,) by name; units in names, `p_Rail [bar]`, `lift_um`; an index of moments or
    floats is the time. layout: as `[recording]` of a bench file, None: as names say; with `rate_hz` no time is
    needed; name: in messages; density: of the fuel [kg/m3], for a rate of mass. Raises `UserError` with the layout to
    state where names and units do not say which column is which.
    """
    held, notes = _in_arrow(table, name), list[str]()
    if layout is None:
        layout = layout_of(name, headings_of(held.schema))
        notes = [f"{name}: {in_words(layout)}"]
    elif not isinstance(layout, RecordingConfig):
        layout = validated(RecordingConfig, layout, lambda *key: f"{name}, layout {'.'.join(map(str, key))}", "bench")
    mapped = HeldTable(name, layout, held)
    mapped.density = density
    stream = MappedSignals(mapped, 0.0)
    stream.refuse_unknown_needle()
    stream.notes = (*notes, *stream.notes)
    return stream
