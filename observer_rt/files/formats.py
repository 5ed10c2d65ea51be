"""The one registry of formats of recordings and CAN logs; a further format is an entry of `SIGNALS` or `LOGS`."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from observer_rt.config.bench import BenchInjector
from observer_rt.config.injector_sections import Meaning, RecordingConfig
from observer_rt.files.canlog.blf import BLF
from observer_rt.files.canlog.can_log import LogFormat, LogReader, LogWriter
from observer_rt.files.canlog.candump import CANDUMP
from observer_rt.files.canlog.python_can import ASC, CSV_LOG, TRC
from observer_rt.files.mdf4.can_log import MDF4_LOG
from observer_rt.files.signals.arrow_table import ParquetTable
from observer_rt.files.signals.csv_table import CsvTable, take_shots
from observer_rt.files.signals.mapped_signals import MappedSignals
from observer_rt.files.signals.mdf4_table import Mdf4Table
from observer_rt.files.signals.naming import in_words, layout_of
from observer_rt.files.signals.recording import COMPANION_SUFFIXES, SHOTS_SUFFIX, Recording
from observer_rt.files.signals.stream import SignalStream
from observer_rt.files.signals.table import SignalFormat
from observer_rt.files.signals.table_signals import EvenSignals, TableSignals
from observer_rt.files.signals.table_writers import PRINTED, SI, WrittenColumn, recording_writer
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.files import check_suffix, replacing
from observer_rt.foundation.units import MILLISECOND

Format = LogFormat | SignalFormat
F = TypeVar("F", bound=Format)
_BY_PANDAS = "read it by pandas, `ort.read` takes a DataFrame: docs/measurement-tools.md"
_ADVICE = {  # what to do with other kinds of files
    (".xls", ".xlsx", ".xlsm", ".ods"): f"save it as {{0}}.csv, or {_BY_PANDAS}",
    (".mat", ".h5", ".hdf5", ".tdms", ".feather", ".npy", ".npz"): _BY_PANDAS,
    (".sav", ".pkl", ".pickle"): 'in Python: to_parquet("{0}.parquet") of the DataFrame',
    (".mdf", ".dat"): 'in Python: asammdf.MDF("{0}{1}").convert("4.10").save("{0}.mf4")',
    (".pcap", ".pcapng"): "open it in SavvyCAN and save it as Candump/Kayak: {0}.log",
    (".mfc", ".mfe", ".mfm"): "make an .mf4 of it by mdf2finalized, of CSS Electronics",
    (".lvm",): "name it {0}.txt",
    (".gz",): "unpack it first: gunzip {0}{1}",
    (".zst", ".zip", ".7z", ".bz2", ".xz"): "unpack it first",
}


def _by_header(columns: Sequence[WrittenColumn]) -> RecordingConfig:
    mapped = {column.channel: {"column": column.header, "unit": column.unit} for column in columns}
    return RecordingConfig.model_validate(mapped)


_CHANNELS = RecordingConfig.model_validate({column.channel: {"column": column.channel} for column in SI[1:]})
SIGNALS = (
    SignalFormat(".csv", CsvTable, _by_header(PRINTED)),
    SignalFormat(".mf4", Mdf4Table, _CHANNELS),
    SignalFormat(".parquet", ParquetTable, _by_header(SI)),
    SignalFormat(".txt", CsvTable, _by_header(PRINTED), is_written=False),
)
"""Every format of recordings."""
LOGS = (CANDUMP, BLF, ASC, TRC, MDF4_LOG, CSV_LOG)
"""Every format of CAN logs."""


def suffixes_of(kinds: Iterable[Format]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(kind.suffix for kind in kinds))


SUFFIXES = suffixes_of((*SIGNALS, *LOGS))
SIGNALS_WRITTEN = suffixes_of(kind for kind in SIGNALS if kind.is_written)
LOGS_WRITTEN = suffixes_of(kind for kind in LOGS if kind.writer is not None)


def is_log(path: Path) -> bool:
    """Whether a file holds CAN frames, by suffix, else content. Raises `UserError` if unknown, missing or damaged."""
    _check_suffix(path, SUFFIXES)
    log = next((kind for kind in LOGS if kind.suffix == path.suffix.lower()), None)
    if log is None or log.recognises is None:
        return log is not None
    with file_errors(path):
        return log.recognises(path)


def open_log(path: Path) -> LogReader:
    """The reader of a log; nothing is read before it is iterated. Raises `UserError` for an unknown suffix."""
    return _format_of(path, LOGS).reader(path)


def open_writer(path: Path, start_ns: int) -> LogWriter:
    """The writer of a log that begins at a time [ns]. Raises `UserError` for a suffix that cannot be written."""
    writer = _format_of(path, [kind for kind in LOGS if kind.writer is not None]).writer
    assert writer is not None
    return writer(path, start_ns)


def stamp_step(path: Path) -> int:
    """Whole number of ns to which a log of this suffix is stamped. Raises `UserError` for an unknown one."""
    return _format_of(path, LOGS).stamp_step


def open_recording(path: Path, injector: BenchInjector | None = None, density: float | None = None) -> SignalStream:
    """Look through a recording and return the stream of its samples [SI], which is then read in parts.

    injector: whose `[recording]` describes the layout; None: our own, or by headings. density: of the fuel [kg/m3],
    for rates of mass; None: the injector's. Raises `UserError` for an unknown suffix, or an unreadable file.
    """
    kind = _format_of(path, SIGNALS)
    if path.name.endswith(COMPANION_SUFFIXES):
        problem = "is the truth behind a simulated recording, or the shots beside a recording, no recording itself"
        raise UserError(str(path), problem, "leave it out; shots are read with the recording beside them")
    with file_errors(path):
        shots = path.with_suffix(SHOTS_SUFFIX)
        has_shots = shots.is_file()
        stream = _signals(path, kind, injector, density, has_shots)
        if has_shots:
            take_shots(shots, stream)
        stream.refuse_unknown_needle()
    if injector is not None:
        sampling, mapping = injector.config.sampling, injector.config.recording
        stream.meaning = (mapping.meaning if mapping is not None else None) or sampling.meaning
        if sampling.rate_meter_ms is not None:
            stream.meter = tuple(lag * MILLISECOND for lag in sampling.rate_meter_ms)
    if stream.meaning is Meaning.MEAN and isinstance(stream, MappedSignals) and stream.is_resampled:
        raise UserError(
            str(path),
            f"its samples, which are means, are not on a grid of {stream.sample_rate:g} Hz, and cannot be resampled",
            'set sampling.rate_hz to the rate of the file, or say meaning = "instant" if that is what they are',
        )
    return stream


def _signals(
    path: Path, kind: SignalFormat, injector: BenchInjector | None, density: float | None, has_shots: bool
) -> TableSignals:
    """Signals by our layout, else the user's `[recording]`, else headings. has_shots: of a table, for the lift."""
    mapping = injector.config.recording if injector is not None else None
    lift = kind.mapping.needle_lift
    if has_shots and lift is not None and lift.column not in kind.table.names(path):
        kind = replace(kind, mapping=kind.mapping.model_copy(update={"needle_lift": None}))
    if kind.is_own(path, mapping):
        table = kind.table(path, kind.mapping, is_own=True)
        return EvenSignals(table) if len(table.rasters) == 1 else MappedSignals(table, 0.0)
    layout = mapping or layout_of(str(path), kind.table.headings(path), kind.table.brings_time, has_shots)
    table = kind.table(path, layout)
    table.density = density if injector is None or density is not None else injector.coefficients.density
    if injector is not None and mapping is not None:
        return MappedSignals(table, injector.sample_rate)
    table.mapped_by = "by its heading"
    stream = MappedSignals(table, 0.0)
    stream.notes = (f"{path}: {in_words(layout)}", *stream.notes)
    return stream


def read_recording(path: Path, injector: BenchInjector | None = None) -> Recording:
    """Read a recording into memory: arrays (n,) [SI], NaN between its stretches. Errors as of `open_recording`."""
    with file_errors(path):
        return open_recording(path, injector).collected()


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording in one step. Raises `UserError` for suffix or path, `RunError` when writing fails."""
    _check_suffix(path, SIGNALS_WRITTEN)
    with file_errors(path), replacing(path) as part, recording_writer(part, recording.recorded) as write:
        write(recording)


def _check_suffix(path: Path, suffixes: Collection[str]) -> None:
    """Call `check_suffix`, with a remedy for files of a kind that is met but not read."""
    try:
        check_suffix(str(path), path, suffixes)
    except UserError as error:
        for kinds, advice in _ADVICE.items():
            if path.suffix.lower() in kinds:
                remedy = f"{advice.format(path.stem, path.suffix)}; {error.remedy}"
                raise UserError(error.location, error.problem, remedy) from None
        raise


def _format_of(path: Path, kinds: Sequence[F]) -> F:
    _check_suffix(path, suffixes_of(kinds))
    return next(kind for kind in kinds if path.suffix.lower() == kind.suffix)
