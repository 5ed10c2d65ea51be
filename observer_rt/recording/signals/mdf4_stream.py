"""Recordings as MDF4, ASAM's measurement file; what touches the file runs apart (`mdf4_file.py`)."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.recording.mdf4_apart import mdf4_apart
from observer_rt.recording.mdf4_records import count_records
from observer_rt.recording.signals.checked import GridSignals
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE

FILE = "observer_rt.recording.signals.mdf4_file"


class Mdf4Signals(GridSignals):
    """A recording by the names of its channels, as `mdf4_file.parts`."""

    def __init__(self, path: Path, in_one_go: bool = False) -> None:
        super().__init__(path, in_one_go)
        self._look()

    def _place(self, row: int) -> str:
        return f"{self._file}, sample {row}"

    def _parts(self) -> Iterator[dict[str, NDArray[np.float64]]]:
        parts = mdf4_apart(FILE, "parts", self._file, count_records(self._file), SAMPLES_AT_ONCE)
        self.notes = tuple(f"{self._file}: {remark}" for remark in next(parts))
        yield from parts


def read_mdf4(path: Path) -> Recording:
    """Read a recording, as `Mdf4Signals`."""
    return Mdf4Signals(path).collected()


def mdf4_names(path: Path) -> list[str]:
    """Of the channels."""
    (names,) = mdf4_apart(FILE, "names", path)
    return list(names)
