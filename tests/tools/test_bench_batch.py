"""`tools/bench batch`: what its figures are of, on batches made up so that the answer is known."""

from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.foundation.files import file_hash
from tools.benchmarks.batch import Many, Taken, Work, figures, many_document
from tools.benchmarks.speed.core_alone import INJECTIONS

START, A_FILE, REPEATS = 5.0, 2.0, 8  # s, s a file
CORE = 1000.0  # injections a second


def taken(work: Work, slower: float = 1.0) -> Taken:
    seconds = START + A_FILE * work.files * slower
    return Taken(work, seconds / work.workers, seconds, 300.0)


MANY = Many(
    (0.1, 0.2),
    CORE,
    taken(Work(2, REPEATS)),
    taken(Work(8, REPEATS)),
    taken(Work(8, REPEATS, workers=2)),
    taken(Work(8, REPEATS, learning=True), slower=3.0),
)


def test_figures_are_those_beyond_the_start() -> None:
    found = {figure.name: figure.value for figure in figures(MANY)}
    a_second = INJECTIONS * REPEATS / A_FILE
    assert found["injections_per_s_per_core"] == pytest.approx(a_second)
    assert found["injections_per_s_per_core_learning"] == pytest.approx(a_second / 3.0)
    assert found["floor_share"] == pytest.approx(a_second / CORE)
    assert found["efficiency_2_workers"] == pytest.approx(1.0)
    assert found["peak_memory_mib"] == 300.0


def test_a_bar_that_is_missed_is_named() -> None:
    grown = replace(MANY, core_per_s=1e5, many=replace(MANY.many, peak_mib=330.0))
    assert many_document(grown)["details"]["missed"] == ["floor_share", "memory_growth_share"]


def test_every_file_has_a_content_of_its_own(tmp_path: Path) -> None:
    files = sorted(Work(2, 1).written(tmp_path).iterdir())
    assert [path.name for path in files] == ["0.parquet", "1.parquet"]
    assert file_hash(files[0]) != file_hash(files[1])
