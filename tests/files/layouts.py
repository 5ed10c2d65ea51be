"""One recording as other tools write it: files in many layouts and of many kinds, and tables in memory."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from asammdf import MDF, Signal
from numpy.typing import NDArray
from pyarrow import Table as ArrowTable
from pyarrow import parquet

from observer_rt.files.signals.recording import Recording

Columns = Mapping[str, NDArray[np.float64]]
GERMAN = ("Zeit [µs]", "p_Rail [bar]", "Nadelhub [µm]", "p_Leitung [bar]")
ENGLISH = ("time_s", "rail_pressure_bar", "needle_lift_um", "line_pressure_bar")
PLAIN = ("t", "rail", "lift", "line")
NOON = np.datetime64("2026-03-01T12:00:00", "ns")
IN_TWO_ROWS = pd.MultiIndex.from_arrays([PLAIN, ("s", "[bar]", "um", "bar")])


def columns(recording: Recording, names: Sequence[str], time: float = 1.0) -> dict[str, NDArray[np.float64]]:
    """Time [s * time], bar, um, bar under some names."""
    shown = (
        recording.time * time,
        recording.rail_pressure / 1e5,
        recording.needle_lift * 1e6,
        recording.line_pressure / 1e5,
    )
    return dict(zip(names, shown, strict=True))


def text(
    recording: Recording,
    names: Sequence[str] = GERMAN,
    separator: str = ";",
    decimal: str = ".",
    form: str = ".4f",
    above: Sequence[str] = (),
    under: Sequence[str] = (),
    time: float = 1e6,
) -> str:
    """CSV. above: lines above the names; under: cells of a line below these."""
    table = np.array(list(columns(recording, names, time).values())).T
    rows = [separator.join(format(value, form).replace(".", decimal) for value in row) for row in table]
    head = [separator.join(line) for line in (names, under) if line]
    return "\n".join([*above, *head, *rows, ""])


class Layout(NamedTuple):
    """A way to write a recording. make: gives the file in a folder, or the table."""

    name: str
    make: Callable[[Path, Recording], Any]


def _csv(
    name: str,
    file: str = "a.csv",
    encoding: str = "utf-8",
    change: Callable[[str], str] = lambda content: content,
    **how: Any,
) -> Layout:
    def make(folder: Path, recording: Recording) -> Path:
        (folder / file).write_bytes(change(text(recording, **how)).encode(encoding))
        return folder / file

    return Layout(name, make)


def _stamped(content: str, start: Any = NOON) -> str:
    head, *rows = content.splitlines()
    stamps = [start + np.timedelta64(round(float(row.split(",", 1)[0]) * 1e3), "ns") for row in rows]
    stamped = (f"{stamp},{row.split(',', 1)[1]}" for stamp, row in zip(stamps, rows, strict=True))
    return "\n".join([head, *stamped, ""])


def _frame(recording: Recording) -> pd.DataFrame:
    return pd.DataFrame(columns(recording, ENGLISH))


def _mdf(folder: Path, recording: Recording, version: str, suffix: str) -> Path:
    time, *remaining = columns(recording, PLAIN).items()
    units = zip(remaining, ("bar", "um", "bar"), strict=True)
    with MDF(version=version) as file:
        file.append([Signal(values, time[1], unit=unit, name=name) for (name, values), unit in units])
        saved = Path(file.save(folder / f"a.{suffix}", overwrite=True))
    return saved.rename(folder / f"a.{suffix}")


def _parquet(folder: Path, recording: Recording, is_dated: bool, of_day: bool = False) -> Path:
    frame = _frame(recording)
    if is_dated:
        start = pd.Timestamp("2026-03-01T23:59:59.9")
        stamps = pd.Series(start + pd.to_timedelta(np.rint(recording.time * 1e9), unit="ns"))
        frame["time_s"] = stamps.dt.time if of_day else stamps
        frame = frame.rename(columns={"time_s": "stamp"})
    parquet.write_table(ArrowTable.from_pandas(frame), folder / "a.parquet", write_page_checksum=True)
    return folder / "a.parquet"


def _indexed(recording: Recording) -> pd.DataFrame:
    frame = _frame(recording).drop(columns="time_s")
    start = pd.Timestamp("2026-03-01T12:00:00", tz="Europe/Berlin")
    frame.index = pd.Index(start + pd.to_timedelta(np.rint(recording.time * 1e9), unit="ns"))
    return frame


LAYOUTS = (
    _csv(
        "the reviewer's",
        encoding="cp1252",
        decimal=",",
        above=["Prüfstand 4", "Lauf 12"],
        change=lambda content: content.replace("\n", "\r\n"),
    ),
    _csv(
        "numbered rows",
        change=lambda content: "".join(
            f"{'' if row < 0 else row};{line}\n" for row, line in enumerate(content.splitlines(), -1)
        ),
    ),
    _csv("a line of units", names=PLAIN, under=("us", "bar", "um", "bar")),
    _csv("bracketed units below", names=PLAIN, under=("[ms]", "[bar]", "[µm]", "[bar]"), time=1e3, form=".5f"),
    _csv("moments", separator=",", names=("stamp", *GERMAN[1:]), change=_stamped),
    _csv("moments of text", separator=",", names=("t", *GERMAN[1:]), change=partial(_stamped, start=pd.Timedelta(0))),
    _csv("text, zeros behind", file="a.txt", change=lambda content: content + "\0" * 300_000),
    _csv(
        "English",
        names=("Time (ms)", "Common rail pressure (bar)", "Needle lift (um)", "Inlet pressure (bar)"),
        time=1e3,
        form=".5f",
    ),
    _csv(
        "French",
        names=("Temps [ms]", "Pression rampe [bar]", "Levée aiguille [µm]", "Pression conduite [bar]"),
        time=1e3,
        form=".5f",
    ),
    _csv("commented names", separator=",", names=("# Zeit [µs]", *GERMAN[1:])),
    Layout("MDF 4", lambda folder, recording: _mdf(folder, recording, "4.10", "mf4")),
    Layout("Parquet", lambda folder, recording: _parquet(folder, recording, is_dated=False)),
    Layout("Parquet moments", lambda folder, recording: _parquet(folder, recording, is_dated=True)),
    Layout("Parquet times of day", lambda folder, recording: _parquet(folder, recording, is_dated=True, of_day=True)),
    Layout("DataFrame of text", lambda _, made: _frame(made).map(lambda value: f"{value:.7f}".replace(".", ","))),
    Layout("DataFrame with a row of units", lambda _, recording: _frame(recording).set_axis(IN_TWO_ROWS, axis=1)),
    Layout("DataFrame of moments", lambda _, recording: _indexed(recording)),
    Layout("arrays", lambda _, recording: columns(recording, GERMAN, 1e6)),
)
