"""What a user names as recordings, and which injector a file is of."""

from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.fleet.groups import InjectorNames, recordings_in
from observer_rt.foundation.errors import UserError


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
    found = recordings_in([str(folder / "b.csv"), str(folder / "*.csv"), str(folder / "**" / "*.blf")])
    assert [path.name for path in found][:1] == ["b.csv"]
    assert [path.name for path in found].count("b.csv") == 1
    assert found[-1].name == "c.blf"


@pytest.mark.parametrize("nothing", ["absent.csv", "absent_*.csv", "empty"])
def test_what_names_nothing_is_refused_by_name(folder: Path, nothing: str) -> None:
    (folder / "empty").mkdir()
    with pytest.raises(UserError, match=nothing.replace("*", r"\*")):
        recordings_in([str(folder / nothing)])


def test_the_injector_is_read_off_the_path() -> None:
    alone = load_bench()
    assert InjectorNames(r"inj_(\d+)").of(Path("runs/inj_07/x.csv"), alone) == "07"
    assert InjectorNames(r"inj_\d+").of(Path("runs/inj_07/x.csv"), alone) == "inj_07"
    assert InjectorNames(None).of(Path("x.csv"), alone) == "injector_1"
    with pytest.raises(UserError, match=r"x\.csv"):
        InjectorNames(r"inj_(\d+)").of(Path("x.csv"), alone)
    with pytest.raises(UserError, match="no regular expression"):
        InjectorNames("(")
