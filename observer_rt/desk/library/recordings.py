"""Recordings in whichever form they come: files, tables, arrays, one or many."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from rich.console import Console

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench
from observer_rt.desk.evaluation.logged import open_source
from observer_rt.desk.library.notes import noted
from observer_rt.engine.signal_survey import refuse_implausible
from observer_rt.files.signals.recording import SIGNALS, Recording
from observer_rt.files.signals.stream import HeldSignals, SignalStream
from observer_rt.files.signals.table_writers import PRINTED
from observer_rt.files.tables_in_memory import signals_of
from observer_rt.foundation.console import say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_hash

RecordingLike: TypeAlias = str | PathLike[str] | Recording | pd.DataFrame | Mapping[str, Any]
"""A recording: its file, the recording itself, a table, or arrays by name."""
Recordings: TypeAlias = RecordingLike | Sequence[RecordingLike]
_SI = {"time", "rail_pressure", "line_pressure"}  # names of a `Recording`, whose arrays are in SI units


def path_of(parameter: str, value: str | PathLike[str]) -> Path:
    """Path that a parameter gives. Raises `TypeError` for other types."""
    if not isinstance(value, str | PathLike):
        raise TypeError(f"{parameter}: {type(value).__name__} is no path; give a str or a pathlib.Path")
    return Path(value)


def read(recording: RecordingLike, bench: str | PathLike[str] | None = None) -> Recording:
    """Read a recording into memory.

    Parameters
    ----------
    recording : path, DataFrame, mapping of arrays, or Recording
        A file in any format that is read. Columns are found by names and units, such as those of `to_frame`;
        named as the arrays of a `Recording` they are in SI units.
    bench : path, optional
        Bench file whose `[recording]` describes the columns.

    Returns
    -------
    Recording
        Time and signals in SI units, arrays of shape (n,).

    Raises
    ------
    UserError
        For a file or a table that cannot serve, with the remedy.
    TypeError
        For other types.

    Examples
    --------
    >>> recording = ort.read("worn.csv")  # doctest: +SKIP
    """
    loaded = load_bench(EXAMPLE_BENCH if bench is None else path_of("bench", bench), off_bus=True)
    with noted() as notes:
        (source,) = sources_of([recording], loaded, notes.console)
        return source.collected()


def to_frame(recording: Recording) -> pd.DataFrame:
    """Table of a recording.

    Parameters
    ----------
    recording : Recording
        As of `read` or `simulate`.

    Returns
    -------
    DataFrame
        A row a sample; the end of a column's name is its unit.
    """
    arrays = recording.arrays
    return pd.DataFrame({c.header: arrays[c.channel] / c.factor for c in PRINTED if c.channel in arrays})


def sources_of(recordings: Recordings, bench: Bench, console: Console) -> list[SignalStream]:
    """Recordings looked through, files by the bench's `[recording]`; those in memory are named by their number.

    Raises `TypeError` for other types, `UserError` for a recording that cannot serve.
    """
    several = _listed(recordings)
    if not several:
        raise UserError("recordings", "there is none", "give a file, a DataFrame, or a list of them")
    return [_source(recording, number, bench, console) for number, recording in enumerate(several, 1)]


def _listed(recordings: Recordings) -> list[RecordingLike]:
    is_one = isinstance(recordings, str | PathLike | Recording | pd.DataFrame | Mapping)
    if not is_one and not isinstance(recordings, Sequence):
        raise TypeError(
            f"recordings: {type(recordings).__name__} is no recording; give a path, a DataFrame, a mapping of "
            "arrays, a Recording, or a list of them"
        )
    return [recordings] if is_one else list(recordings)  # type: ignore[arg-type]  # as was looked at


def _source(recording: RecordingLike, number: int, bench: Bench, console: Console) -> SignalStream:
    path, layout = Path(f"recording {number}"), bench.injector.config.recording
    match recording:
        case str() | PathLike():
            return open_source(Path(recording), bench, (), console)
        case Recording():
            held = recording if recording.path is not None else replace(recording, path=path)
            stream: SignalStream = HeldSignals(held)
        case Mapping() | pd.DataFrame() if layout is None and _SI <= set(recording) <= {"time", *SIGNALS}:
            arrays: dict[str, Any] = {str(column): np.asarray(recording[column], float) for column in recording}
            arrays.setdefault("needle_lift", np.full(arrays["time"].shape, np.nan))
            stream = HeldSignals(Recording(**arrays, path=path))
        case Mapping() | pd.DataFrame():
            stream = signals_of(recording, layout, str(path), bench.injector.coefficients.density)
        case _:
            forms = "a path, a DataFrame, a mapping of arrays or a Recording"
            raise TypeError(f"{path}: {type(recording).__name__} is none; give {forms}")
    refuse_implausible(stream.path, stream.survey, stream.names)
    for note in stream.notes:
        say(console, note)
    return stream


def digests(sources: Sequence[SignalStream]) -> dict[str, str]:
    """SHA-256 by name: of files, or of the values of recordings in memory."""
    return {str(source.path): _digest(source) for source in sources}


def _digest(source: SignalStream) -> str:
    if source.path is not None and source.path.is_file():
        return file_hash(source.path)
    digest = hashlib.sha256()
    for values in source.collected().arrays.values():
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
