"""Files on an even grid are the same whatever parts a reader gives them in."""

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.injector_sections import ColumnConfig, RecordingConfig
from observer_rt.files.formats import open_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table import Table, TablePart
from observer_rt.files.signals.table_signals import EvenSignals
from observer_rt.foundation.errors import UserError

COLUMNS = RecordingConfig(
    rail_pressure=ColumnConfig(column="rail_pressure", unit="Pa"),
    needle_lift=ColumnConfig(column="needle_lift", unit="m"),
    line_pressure=ColumnConfig(column="line_pressure", unit="Pa"),
)
SIGNALS = ("rail_pressure", "needle_lift", "line_pressure")


class InParts(Table):
    """A file whose reader gives so many samples at once."""

    brings_time = True

    def __init__(self, sizes: list[int]) -> None:
        super().__init__(Path("parts"), COLUMNS)
        self._sizes = sizes
        self.mapped = dict(COLUMNS.signals)
        self.rasters = (SIGNALS,)

    @staticmethod
    def names(path: Path) -> Collection[str]:
        return SIGNALS

    def parts(self, raster: int) -> Iterator[TablePart]:
        first = 0
        for size in self._sizes:
            values = np.arange(first, first + size, dtype=np.float64)
            first += size
            yield TablePart(values / 1e5, dict.fromkeys(SIGNALS, values))

    def location(self, row: int, raster: int) -> str:
        return f"parts, row {row}"


@given(st.lists(st.integers(0, 3), max_size=8))
def test_parts_of_any_length(sizes: list[int]) -> None:
    samples = sum(sizes)
    if samples < 2:
        with pytest.raises(UserError, match=r"holds (no sample|one sample only)"):
            EvenSignals(InParts(sizes))
        return
    chunks = list(EvenSignals(InParts(sizes)).chunks())
    assert np.concatenate([chunk.rail_pressure for chunk in chunks]).tolist() == list(range(samples))
    assert [chunk.first for chunk in chunks] == np.cumsum([0, *(c.samples for c in chunks[:-1])]).tolist()
    assert all(chunk.samples for chunk in chunks)


@pytest.mark.parametrize(
    ("stated", "heading"),
    [
        (20 + 3 * SAMPLES_AT_ONCE, "counts 49152 samples that are not in it: its end may be missing"),
        (12, "leaves out 8 samples that are in it: it may be damaged"),
    ],
)
def test_a_heading_that_counts_other_samples_than_there_are(tmp_path: Path, stated: int, heading: str) -> None:
    """As damage of its bytes leaves it: later parts are empty."""
    path = tmp_path / "counted.mf4"
    values = np.arange(20.0)
    write_recording(path, Recording(values / 1e5, values * 1e5, values * 1e-6, values * 1e5))
    data = bytearray(path.read_bytes())
    count = data.index(b"##CG") + 24 + 6 * 8 + 8
    assert data[count] == 20
    data[count : count + 8] = stated.to_bytes(8, "little")
    path.write_bytes(data)
    stream = open_recording(path)
    assert stream.samples == min(20, stated)
    assert stream.notes == (f"{path}: its heading {heading}",)
