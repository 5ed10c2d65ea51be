"""Recordings from tables in memory: pandas DataFrames, arrays by name."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from observer_rt.config.injector import RecordingConfig
from observer_rt.config.toml_file import validated
from observer_rt.files.guess.guess import guess_of
from observer_rt.files.signals.column import columns_of
from observer_rt.files.signals.held_table import HeldTable
from observer_rt.files.signals.mapped_signals import MappedSignals
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import SignalStream


def recording_of(
    table: Any, layout: RecordingConfig | Mapping[str, Any] | None = None, name: str = "table"
) -> Recording:
    """Recording of a table in memory [SI], as `read_recording` gives that of a file; NaN between its stretches.

    table: pandas DataFrame, or arrays (n,) by name in a dict; units in brackets or at the end of names,
    `p_Rail [bar]`, `lift_um`; an index of moments or floats is the time. layout: what `[recording]` of a bench file
    says, None: what names, units and values say beyond doubt; with `rate_hz` no time is needed. name: in messages.
    Raises `UserError` with the layout to state where it is not certain which column is which, and for other mistakes.
    """
    return signals_of(table, layout, name).collected()


def signals_of(
    table: Any, layout: RecordingConfig | Mapping[str, Any] | None = None, name: str = "table"
) -> SignalStream:
    """The same as a stream, whose survey tells what is odd about its values."""
    columns = columns_of(table)
    note: tuple[str, ...] = ()
    if layout is None:
        guess = guess_of(name, columns)
        if guess.doubts:
            raise guess.error()
        layout, note = guess.layout, (guess.in_words(),)
    elif not isinstance(layout, RecordingConfig):
        layout = validated(RecordingConfig, layout, partial(_place, name), "bench")
    stream = MappedSignals(HeldTable(Path(name), layout, columns, "a table in memory"), 0.0)
    stream.notes = (*note, *stream.notes)
    return stream


def _place(name: str, *keys: str | int) -> str:
    return f"{name}, layout {'.'.join(map(str, keys))}"
