"""The formats of recordings. Slow libraries are imported only where they are needed."""

from functools import partial
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.recording.signals.csv_file import COLUMNS, REQUIRED, CsvSignals, csv_names, read_csv
from observer_rt.recording.signals.mapped.csv_table import CsvTable
from observer_rt.recording.signals.mapped.mdf4_table import Mdf4Table
from observer_rt.recording.signals.mapped.table import Table
from observer_rt.recording.signals.mdf4_stream import Mdf4Signals, mdf4_names, read_mdf4
from observer_rt.recording.signals.parquet_file import (
    COLUMNS as PARQUET_COLUMNS,
)
from observer_rt.recording.signals.parquet_file import (
    OPTIONAL,
    ParquetSignals,
    parquet_names,
    read_parquet,
)
from observer_rt.recording.signals.signal_format import Layouts, SignalFormat
from observer_rt.recording.signals.writers import write_whole


def _parquet_table(path: Path, config: RecordingConfig) -> Table:
    from observer_rt.recording.signals.mapped.parquet_table import ParquetTable

    return ParquetTable(path, config)


_HEADER = f"{','.join(column.header for column in REQUIRED)}[,{COLUMNS[-1].header}]"
CSV = SignalFormat(
    (".csv",),
    _HEADER,
    read_csv,
    write_whole,
    Layouts(
        frozenset(column.header for column in REQUIRED),
        csv_names,
        CsvSignals,
        CsvTable,
        partial(CsvSignals, in_one_go=True),
    ),
)
MDF4_SIGNALS = SignalFormat(
    (".mf4",),
    "ASAM MDF4, one channel a signal, with its unit",
    read_mdf4,
    write_whole,
    Layouts(
        frozenset(("rail_pressure", "needle_lift", "line_pressure")),
        mdf4_names,
        Mdf4Signals,
        Mdf4Table,
        partial(Mdf4Signals, in_one_go=True),
    ),
)
PARQUET = SignalFormat(
    (".parquet",),
    f"Parquet, {','.join(name for name in PARQUET_COLUMNS if name != OPTIONAL)}[,{OPTIONAL}]",
    read_parquet,
    write_whole,
    Layouts(
        frozenset(PARQUET_COLUMNS) - {OPTIONAL},
        parquet_names,
        ParquetSignals,
        _parquet_table,
        partial(ParquetSignals, in_one_go=True),
    ),
)
