"""The formats of recordings. Slow libraries are imported only where they are needed."""

from collections.abc import Collection
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.recording.signals.csv_file import COLUMNS, REQUIRED, CsvSignals, csv_names, read_csv
from observer_rt.recording.signals.mapped.csv_table import CsvTable
from observer_rt.recording.signals.mapped.table import Table
from observer_rt.recording.signals.parquet_file import (
    COLUMNS as PARQUET_COLUMNS,
)
from observer_rt.recording.signals.parquet_file import (
    OPTIONAL,
    ParquetSignals,
    parquet_names,
    read_parquet,
)
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.signal_format import Layouts, SignalFormat
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.recording.signals.writers import write_whole


def _mdf4_names(path: Path) -> Collection[str]:
    from observer_rt.recording.signals.mdf4_file import mdf4_names

    return mdf4_names(path)


def _mdf4_stream(path: Path) -> SignalStream:
    from observer_rt.recording.signals.mdf4_file import Mdf4Signals

    return Mdf4Signals(path)


def _mdf4_table(path: Path, config: RecordingConfig) -> Table:
    from observer_rt.recording.signals.mapped.mdf4_table import Mdf4Table

    return Mdf4Table(path, config)


def _parquet_table(path: Path, config: RecordingConfig) -> Table:
    from observer_rt.recording.signals.mapped.parquet_table import ParquetTable

    return ParquetTable(path, config)


def _read_mdf4(path: Path) -> Recording:
    return _mdf4_stream(path).collected()


_HEADER = f"{','.join(column.header for column in REQUIRED)}[,{COLUMNS[-1].header}]"
CSV = SignalFormat(
    (".csv",),
    _HEADER,
    read_csv,
    write_whole,
    Layouts(frozenset(column.header for column in REQUIRED), csv_names, CsvSignals, CsvTable),
)
MDF4_SIGNALS = SignalFormat(
    (".mf4",),
    "ASAM MDF4, one channel a signal, with its unit",
    _read_mdf4,
    write_whole,
    Layouts(
        frozenset(("rail_pressure", "needle_lift", "line_pressure")), _mdf4_names, _mdf4_stream, _mdf4_table
    ),
)
PARQUET = SignalFormat(
    (".parquet",),
    f"Parquet, {','.join(name for name in PARQUET_COLUMNS if name != OPTIONAL)}[,{OPTIONAL}]",
    read_parquet,
    write_whole,
    Layouts(frozenset(PARQUET_COLUMNS) - {OPTIONAL}, parquet_names, ParquetSignals, _parquet_table),
)
