"""Recordings from tables in memory: pandas DataFrames, arrays by name."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from observer_rt.config.injector import RecordingConfig
from observer_rt.config.toml_file import validated
from observer_rt.files.signals.held_table import HeldTable, framed, headings_of
from observer_rt.files.signals.mapped_signals import MappedSignals
from observer_rt.files.signals.naming import in_words, layout_of
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import SignalStream


def recording_of(
    table: Any, layout: RecordingConfig | Mapping[str, Any] | None = None, name: str = "table"
) -> Recording:
    """Recording of a table in memory [SI], as `read_recording` gives that of a file; NaN between its stretches.

    table: pandas DataFrame, or arrays (n,) by name in a dict; units in brackets or at the end of names,
    `p_Rail [bar]`, `lift_um`; an index of moments or floats is the time. layout: what `[recording]` of a bench file
    says, None: what names and units say; with `rate_hz` no time is needed. name: in messages.
    Raises `UserError` with the layout to state where names and units do not say which column is which.
    """
    return signals_of(table, layout, name).collected()


def signals_of(
    table: Any, layout: RecordingConfig | Mapping[str, Any] | None = None, name: str = "table"
) -> SignalStream:
    """The same as a stream, whose survey tells what is odd about its values."""
    frame, notes = framed(table), list[str]()
    if layout is None:
        layout = layout_of(name, headings_of(frame))
        notes = [f"{name}: {in_words(layout)}"]
    elif not isinstance(layout, RecordingConfig):
        layout = validated(RecordingConfig, layout, partial(_place, name), "bench")
    stream = MappedSignals(HeldTable(name, layout, frame), 0.0)
    stream.notes = (*notes, *stream.notes)
    return stream


def _place(name: str, *keys: str | int) -> str:
    return f"{name}, layout {'.'.join(map(str, keys))}"
