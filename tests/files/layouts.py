"""One recording as other tools write it: files in many layouts and of many kinds, and tables in memory."""

import gzip
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import pandas as pd
from asammdf import MDF, Signal
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from numpy.typing import NDArray
from pyarrow import Table as ArrowTable
from pyarrow import feather, parquet
from scipy.io import savemat

from observer_rt.files.formats import write_recording
from observer_rt.files.signals.recording import Recording

Columns = Mapping[str, NDArray[np.float64]]
GERMAN = ("Zeit [µs]", "p_Rail [bar]", "Nadelhub [µm]", "p_Leitung [bar]")
ENGLISH = ("time_s", "rail_pressure_bar", "needle_lift_um", "line_pressure_bar")
PLAIN = ("t", "rail", "lift", "line")


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
    table = np.array(list(columns(recording, names or range(4), time).values())).T  # type: ignore[arg-type]
    rows = [separator.join(format(value, form).replace(".", decimal) for value in row) for row in table]
    head = [separator.join(line) for line in (names, under) if line]
    return "\n".join([*above, *head, *rows, ""])


@dataclass(frozen=True)
class Layout:
    """A way to write a recording. make: gives the file in a folder, or the table; told: what its refusal says of it,
    where the section must be confirmed."""

    name: str
    make: Callable[[Path, Recording], Any]
    told: str = ""


def _csv(
    name: str,
    told: str = "",
    file: str = "a.csv",
    encoding: str = "utf-8",
    change: Callable[[str], str] = lambda content: content,
    **how: Any,
) -> Layout:
    def make(folder: Path, recording: Recording) -> Path:
        content = change(text(recording, **how)).encode(encoding)
        (folder / file).write_bytes(gzip.compress(content) if file.endswith(".gz") else content)
        return folder / file

    return Layout(name, make, told)


def _grouped(sign: str) -> Callable[[str], str]:
    """Numbers with separators of thousands, of text with decimal points and `;`."""

    def change(content: str) -> str:
        head, *rows = content.splitlines()
        decimal = "." if sign == "," else ","
        cells = [[f"{float(cell):,.4f}" for cell in row.split(";")] for row in rows]
        swapped = str.maketrans(",.", f"{sign}{decimal}")
        return "\n".join([head, *(";".join(row).translate(swapped) for row in cells), ""])

    return change


def _stamped(content: str) -> str:
    head, *rows = content.splitlines()
    start = np.datetime64("2026-03-01T12:00:00", "ns")
    stamps = [start + np.timedelta64(round(float(row.split(",", 1)[0]) * 1e3), "ns") for row in rows]
    return "\n".join(
        [head, *(f"{stamp},{row.split(',', 1)[1]}" for stamp, row in zip(stamps, rows, strict=True)), ""]
    )


def _exchanged(content: str) -> str:
    head, rest = content.split("\n", 1)
    return head.replace("Rail", "x").replace("Leitung", "Rail").replace("x", "Leitung") + "\n" + rest


def _frame(recording: Recording) -> pd.DataFrame:
    return pd.DataFrame(columns(recording, ENGLISH))


def _excel(folder: Path, recording: Recording, units: bool) -> Path:
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("Messung")
    table = columns(recording, PLAIN if units else ENGLISH)
    if units:
        sheet.append(["Prüfstand 4", "2026-03-01"])
    sheet.append(list(table))
    if units:
        sheet.append(["s", "bar", "µm", "bar"])
    for row in zip(*table.values(), strict=True):
        sheet.append([float(value) for value in row])
    book.save(folder / "a.xlsx")
    return folder / "a.xlsx"


def _matlab_5(folder: Path, recording: Recording, is_structure: bool) -> Path:
    arrays = {name: values[:, None] for name, values in columns(recording, ENGLISH).items()}
    savemat(folder / "a.mat", {"log": arrays} if is_structure else arrays, long_field_names=True)
    return folder / "a.mat"


def _matlab_73(folder: Path, recording: Recording) -> Path:
    path = folder / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, values in columns(recording, ENGLISH).items():
            file[name] = values[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64 HDF5 schema 1.00 ."
    with path.open("r+b") as raw:
        raw.write(head.ljust(124) + b"\x00\x02IM")
    return path


def _hdf5(folder: Path, recording: Recording, has_groups: bool) -> Path:
    units = ("s", "bar", "um", "bar")
    with h5py.File(folder / "a.h5", "w") as file:
        for (name, values), unit in zip(columns(recording, PLAIN).items(), units, strict=True):
            found = file.create_dataset(
                f"daq/{name}" if has_groups else name, data=values, compression="gzip"
            )
            found.attrs["unit"] = unit
    return folder / "a.h5"


def _hdf5_table(folder: Path, recording: Recording) -> Path:
    with h5py.File(folder / "a.hdf5", "w") as file:
        file["log"] = _frame(recording).to_records(index=False)
    return folder / "a.hdf5"


def _mdf(folder: Path, recording: Recording, version: str, suffix: str) -> Path:
    time, *rest = columns(recording, PLAIN).items()
    with MDF(version=version) as file:
        file.append(
            [
                Signal(values, time[1], unit=unit, name=name)
                for (name, values), unit in zip(rest, ("bar", "um", "bar"), strict=True)
            ]
        )
        saved = Path(file.save(folder / f"a.{suffix}", overwrite=True))
    return saved.rename(folder / f"a.{suffix}")


def _tdms(folder: Path, recording: Recording, has_waveforms: bool) -> Path:
    table = columns(recording, PLAIN)
    own = {"wf_increment": 1.0 / recording.sample_rate, "wf_start_offset": float(recording.time[0])}
    channels = [
        ChannelObject("Log", name, values, {"unit_string": unit, **(own if has_waveforms else {})})
        for (name, values), unit in zip(table.items(), ("s", "bar", "um", "bar"), strict=True)
        if name != "t" or not has_waveforms
    ]
    with TdmsWriter(folder / "a.tdms") as writer:
        writer.write_segment([RootObject(), GroupObject("Log"), *channels])
    return folder / "a.tdms"


def _parquet(folder: Path, recording: Recording, is_dated: bool) -> Path:
    frame = _frame(recording)
    if is_dated:
        start = pd.Timestamp("2026-03-01T12:00:00")
        frame["time_s"] = start + pd.to_timedelta(np.rint(recording.time * 1e9), unit="ns")
        frame = frame.rename(columns={"time_s": "stamp"})
    parquet.write_table(ArrowTable.from_pandas(frame), folder / "a.parquet", write_page_checksum=True)
    return folder / "a.parquet"


def _feather(folder: Path, recording: Recording) -> Path:
    feather.write_feather(_frame(recording), folder / "a.feather")
    return folder / "a.feather"


def _numpy(folder: Path, recording: Recording, is_matrix: bool) -> Path:
    path = folder / ("a.npy" if is_matrix else "a.npz")
    table = columns(recording, ENGLISH)
    if is_matrix:
        np.save(path, np.array(list(table.values())).T)
    else:
        np.savez(path, **table)  # type: ignore[arg-type]
    return path


def _own(folder: Path, recording: Recording, suffix: str) -> Path:
    write_recording(folder / f"a{suffix}", recording)
    return folder / f"a{suffix}"


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
    _csv("commas", separator=",", names=ENGLISH, form=".7f", time=1.0),
    _csv("tabulators", separator="\t"),
    _csv("tabulators and decimal commas", separator="\t", decimal=","),
    _csv("blanks", separator=" ", names=ENGLISH, form=".7f", time=1.0),
    _csv("bars", separator="|"),
    _csv("byte order mark", encoding="utf-8-sig"),
    _csv("UTF-16", encoding="utf-16"),
    _csv(
        "quoted",
        change=lambda content: (
            "\n".join(";".join(f'"{cell}"' for cell in line.split(";")) for line in content.splitlines())
            + "\n"
        ),
    ),
    _csv(
        "numbered rows",
        change=lambda content: (
            "\n".join(
                f"{number};{line}" if number >= 0 else f";{line}"
                for number, line in enumerate(content.splitlines(), -1)
            )
            + "\n"
        ),
    ),
    _csv("powers of ten", form=".8E"),
    _csv("a line of units", names=PLAIN, under=("us", "bar", "um", "bar")),
    _csv(
        "bracketed units below", names=PLAIN, under=("[ms]", "[bar]", "[µm]", "[bar]"), time=1e3, form=".5f"
    ),
    _csv("moments", separator=",", names=("stamp", *GERMAN[1:]), change=_stamped),
    _csv("text", file="a.txt"),
    _csv("packed", file="a.csv.gz"),
    _csv("thousands with points", change=_grouped(".")),
    _csv("thousands with commas", change=_grouped(",")),
    _csv("thousands with apostrophes", change=_grouped("'")),
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
    _csv("no units", names=("Zeit", "pRail", "Hub", "pLeitung"), time=1e3, form=".5f"),
    _csv("commented names", separator=",", names=("# Zeit [µs]", *GERMAN[1:])),
    _csv("exchanged names", "exchanged", change=_exchanged),
    _csv(
        "names that say nothing",
        "its name does not say so",
        names=("Zeit", "A", "B", "C"),
        time=1e3,
        form=".5f",
    ),
    _csv("no names", "its name does not say so", names=(), time=1e3, form=".5f"),
    _csv(
        "rounded time",
        "stamps are rounded to 1 ms",
        names=("Zeit [ms]", *GERMAN[1:]),
        time=1e3,
        change=lambda content: (
            "\n".join(
                line if at == 0 else f"{float(line.split(';')[0]):.0f};{line.split(';', 1)[1]}"
                for at, line in enumerate(content.splitlines())
            )
            + "\n"
        ),
    ),
    Layout("own CSV", lambda folder, recording: _own(folder, recording, ".csv")),
    Layout("own MDF 4", lambda folder, recording: _own(folder, recording, ".mf4")),
    Layout("own Parquet", lambda folder, recording: _own(folder, recording, ".parquet")),
    Layout("Excel", lambda folder, recording: _excel(folder, recording, units=False)),
    Layout("Excel with units", lambda folder, recording: _excel(folder, recording, units=True)),
    Layout("MATLAB 5", lambda folder, recording: _matlab_5(folder, recording, is_structure=False)),
    Layout("MATLAB structure", lambda folder, recording: _matlab_5(folder, recording, is_structure=True)),
    Layout("MATLAB 7.3", _matlab_73),
    Layout("HDF5", lambda folder, recording: _hdf5(folder, recording, has_groups=False)),
    Layout("HDF5 group", lambda folder, recording: _hdf5(folder, recording, has_groups=True)),
    Layout("HDF5 table", _hdf5_table),
    Layout("MDF 4", lambda folder, recording: _mdf(folder, recording, "4.10", "mf4")),
    Layout("MDF 3", lambda folder, recording: _mdf(folder, recording, "3.30", "mdf")),
    Layout("MDF 3 as .dat", lambda folder, recording: _mdf(folder, recording, "3.30", "dat")),
    Layout("TDMS waveforms", lambda folder, recording: _tdms(folder, recording, has_waveforms=True)),
    Layout("TDMS", lambda folder, recording: _tdms(folder, recording, has_waveforms=False)),
    Layout("Parquet", lambda folder, recording: _parquet(folder, recording, is_dated=False)),
    Layout("Parquet moments", lambda folder, recording: _parquet(folder, recording, is_dated=True)),
    Layout("Feather", _feather),
    Layout("NumPy arrays", lambda folder, recording: _numpy(folder, recording, is_matrix=False)),
    Layout(
        "NumPy matrix",
        lambda folder, recording: _numpy(folder, recording, is_matrix=True),
        "its name does not say so",
    ),
    Layout("DataFrame", lambda _, recording: _frame(recording)),
    Layout("DataFrame of moments", lambda _, recording: _indexed(recording)),
    Layout("DataFrame of text", lambda _, recording: _frame(recording).astype(str)),
    Layout("arrays", lambda _, recording: columns(recording, GERMAN, 1e6)),
    Layout("negated lift", lambda _, recording: _frame(recording) * [1.0, 1.0, -1.0, 1.0], "inverted"),
)
