"""What a user names as recordings, and what their paths say."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.fleet.recordings import PathPattern, injector_of, recordings_in
from observer_rt.foundation.errors import UserError


def test_a_pattern_names_the_injectors_of_paths() -> None:
    names = PathPattern.read("--injector-from", r"([^/]+)\.\w+$")
    paths = [Path("measured/a.csv"), Path("measured/b.csv")]
    assert [injector_of(path, names, load_bench()) for path in paths] == ["a", "b"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b.csv", "a.mf4", "a.csv.truth.csv", "notes.txt", "deep/er/c.blf"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return tmp_path


def test_a_folder_is_all_recordings_below_it(folder: Path) -> None:
    names = [str(path.relative_to(folder)) for path in recordings_in([str(folder)])]
    assert names == ["a.mf4", "b.csv", "deep/er/c.blf"]


def test_patterns_and_files_come_in_order_and_once(folder: Path) -> None:
    paths = recordings_in([str(folder / "b.csv"), str(folder / "*.csv"), str(folder / "**" / "*.blf")])
    assert [path.name for path in paths] == ["b.csv", "a.csv.truth.csv", "c.blf"]


@pytest.mark.parametrize("nothing", ["absent.csv", "absent_*.csv", "empty"])
def test_a_name_of_nothing_is_refused(folder: Path, nothing: str) -> None:
    (folder / "empty").mkdir()
    with pytest.raises(UserError, match=nothing.replace("*", r"\*")):
        recordings_in([str(folder / nothing)])


def test_the_injector_is_read_off_the_path() -> None:
    path = Path("runs/inj_07/x.csv")
    assert PathPattern.read("--injector-from", r"inj_(\d+)").text_in(path) == "07"
    assert PathPattern.read("--injector-from", r"inj_\d+").text_in(path) == "inj_07"
    assert injector_of(path, None, load_bench()) == "injector_1"
    with pytest.raises(UserError, match=r"x\.csv"):
        PathPattern.read("--injector-from", r"inj_(\d+)").text_in(Path("x.csv"))
    with pytest.raises(UserError, match=r"--injector-from \(: is no regular expression"):
        PathPattern.read("--injector-from", "(")


@pytest.mark.parametrize(
    ("path", "date"),
    [
        ("a/injector_7_20260301_120501.csv", datetime(2026, 3, 1, 12, 5, 1, tzinfo=UTC)),
        ("2026-03-01/run.csv", datetime(2026, 3, 1, tzinfo=UTC)),
    ],
)
def test_a_path_says_when_a_recording_was_made(path: str, date: datetime) -> None:
    dates = PathPattern.read("--time-from", r"(\d{8}_\d{6}|\d{4}-\d\d-\d\d)")
    assert dates.date_in(Path(path)) == date
    with pytest.raises(UserError, match="finds no date"):
        dates.date_in(Path("a/run_99999999_999999.csv"))
