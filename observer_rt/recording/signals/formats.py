"""The formats of recordings, each with the mapping of our own layout."""

from collections.abc import Sequence

from observer_rt.config.recording import RecordingConfig
from observer_rt.recording.signals.mapped.csv_table import CsvTable
from observer_rt.recording.signals.mapped.mdf4_table import Mdf4Table
from observer_rt.recording.signals.mapped.parquet_table import ParquetTable
from observer_rt.recording.signals.signal_format import OwnLayout, SignalFormat
from observer_rt.recording.signals.writers import PRINTED, SI, Column, write_whole


def _header(columns: Sequence[Column]) -> str:
    *needed, optional = (column.header for column in columns)
    return f"{','.join(needed)}[,{optional}]"


def _by_header(columns: Sequence[Column]) -> RecordingConfig:
    return RecordingConfig.model_validate(
        {column.signal: {"column": column.header, "unit": column.unit} for column in columns}
    )


_CHANNELS = RecordingConfig.model_validate({column.signal: {"column": column.signal} for column in SI[1:]})
CSV = SignalFormat((".csv",), _header(PRINTED), OwnLayout(CsvTable, _by_header(PRINTED)), write_whole)
MDF4_SIGNALS = SignalFormat(
    (".mf4",), "ASAM MDF4, one channel a signal, with its unit", OwnLayout(Mdf4Table, _CHANNELS), write_whole
)
PARQUET = SignalFormat(
    (".parquet",), f"Parquet, {_header(SI)}", OwnLayout(ParquetTable, _by_header(SI)), write_whole
)
