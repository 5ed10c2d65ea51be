"""`tools/bench batch`: what its figures are of, on batches made up so that the answer is known."""

from pathlib import Path

import pytest

from observer_rt.foundation.files import file_hash
from tools.benchmarks.batch import Files, Many, Taken, Work, figures, many_document
from tools.benchmarks.speed.core_alone import CAN_LOG, INJECTIONS, MDF4, PARQUET

START, A_FILE, REPEATS = 5.0, 2.0, 8  # s, s a file
CORE = 1000.0  # injections a second


def taken(
    source: str = PARQUET,
    files: int = 8,
    repeats: int = REPEATS,
    workers: int = 1,
    slower: float = 1.0,
    peak_mib: float = 300.0,
) -> Taken:
    seconds = START + A_FILE * files * repeats / REPEATS * slower
    clock = START + (seconds - START) / workers
    a_file = A_FILE * repeats / REPEATS * slower / workers
    return Taken(Work(Files(source, files, repeats), workers), clock, seconds, peak_mib, a_file)


def many(of_two: float = 1.0) -> Many:
    """One worker takes A_FILE a file; two as much less time for it as they should, or `of_two` longer."""
    numbers = tuple(taken(files=number) for number in (2, 4, 8))
    two = tuple(taken(files=number, workers=2, slower=of_two) for number in (2, 4, 8))
    lengths = (taken(files=1, repeats=4), taken(files=1, repeats=64, peak_mib=330.0))
    sources = (numbers[-1], taken(MDF4, slower=2.0), taken(CAN_LOG, slower=4.0))
    return Many((0.1, 0.2), CORE, numbers, two, lengths, sources, taken(slower=3.0))


def values(found: Many) -> dict[str, float | None]:
    return {each.name: each.value for each in figures(found)}


def test_figures_are_those_beyond_the_start() -> None:
    found = values(many())
    a_second = INJECTIONS * REPEATS / A_FILE
    assert found["injections_per_s_per_core"] == pytest.approx(a_second)
    assert found["injections_per_s_per_core_learning"] == pytest.approx(a_second / 3.0)
    assert found["floor_share"] == found["floor_share_parquet"] == pytest.approx(a_second / CORE)
    assert found["floor_share_mdf4"] == pytest.approx(a_second / CORE / 2.0)
    assert found["floor_share_mdf4_can_log"] == pytest.approx(a_second / CORE / 4.0)
    assert found["efficiency_2_workers"] == pytest.approx(1.0)
    assert found["efficiency_2_workers_with_start"] == pytest.approx(21.0 / 2.0 / 13.0)
    assert found["off_linear_files"] == pytest.approx(0.0, abs=1e-12)
    assert found["start_s"] == pytest.approx(START)
    assert found["peak_memory_mib"] == 330.0
    assert found["memory_growth_share"] == pytest.approx(0.1)


def test_a_bar_that_is_missed_is_named() -> None:
    missed = many_document(many(of_two=1.25))["details"]["missed"]
    assert missed == ["floor_share", "efficiency_2_workers", "memory_growth_share"]


def test_every_file_has_a_content_of_its_own(tmp_path: Path) -> None:
    few, more = (sorted(Files(CAN_LOG, number, 1).written(tmp_path).iterdir()) for number in (1, 2))
    assert [path.name for path in few] == ["0.mf4"]
    assert len({file_hash(path) for path in more}) == 2
    assert file_hash(few[0]) == file_hash(more[0])
