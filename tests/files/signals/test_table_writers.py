"""Tables that are written part by part: words, large integers, and missing values."""

from pathlib import Path

import numpy as np
from asammdf import MDF

from observer_rt.files.signals.table_writers import TABLE_WRITERS, WrittenColumn

COLUMNS = (
    WrittenColumn("time_s", "time"),
    WrittenColumn("place", "place", printed="%s", words=("financed", "nano")),
    WrittenColumn("count", "count", printed="%d"),
    WrittenColumn("level", "level"),
)
PARTS = [[np.array([value]) for value in row] for row in ((0.0, 0, 70_000, np.nan), (0.5, 1, 3, 2.5))]


def written(path: Path) -> Path:
    with TABLE_WRITERS[path.suffix](path, COLUMNS) as writer:
        for part in PARTS:
            writer.write(part)
    return path


def test_only_whole_cells_of_csv_are_empty(tmp_path: Path) -> None:
    lines = written(tmp_path / "table.csv").read_text().splitlines()
    assert lines == ["time_s,place,count,level", "0,financed,70000,", "0.5,nano,3,2.5"]


def test_integers_of_mdf4_stay_as_large_as_they_are(tmp_path: Path) -> None:
    with MDF(written(tmp_path / "table.mf4")) as file:
        assert file.get("count").samples.tolist() == [70_000, 3]
        assert file.get("place").samples.tolist() == [b"financed", b"nano"]
