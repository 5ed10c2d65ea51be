"""What a user names as recordings, of which injector each is, and which of them discovery takes together."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench
from observer_rt.desk.fleet.groups import (
    MOST_RECORDINGS,
    NEEDED,
    Group,
    InjectorNames,
    RecordingTimes,
    doubt_of_one,
    groups_of,
    kinds_of,
    recordings_in,
)
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import rows
from tests.several_injectors import write_bench
from tests.three_injectors import NAMES, three_injectors


def grouped(*tables: pa.Table, files: dict[str, Path] | None = None) -> list[Group]:
    table = pa.concat_tables(tables).select(NEEDED)
    known = {name: Path(f"{name}.csv") for name in table["sha256"].to_pylist()}
    return groups_of(table, known if files is None else files, kinds_of(load_bench(), "named_by_rows"))


def test_an_injector_is_a_group_its_latest_recording_first() -> None:
    two, one = grouped(
        rows("aa", "worn", [0.2, 0.1], day=3), rows("bb", "worn", [0.1], day=7), rows("cc", "new", [0.1])
    )[::-1]
    assert (one.injector, two.injector) == ("new", "worn")
    assert two.files == ((Path("bb.csv"), "bb"), (Path("aa.csv"), "aa"))
    assert two.recordings == 2


def test_only_recordings_of_this_run_count() -> None:
    """Others may be anywhere by now."""
    (group,) = grouped(rows("aa", "one", [0.1]), rows("bb", "two", [0.1]), files={"aa": Path("moved/aa.csv")})
    assert group.files == ((Path("moved/aa.csv"), "aa"),)


def test_of_many_recordings_the_latest_are_taken() -> None:
    (group,) = grouped(*(rows(f"{day:03}", "one", [0.1], day=day) for day in range(40)))
    assert [sha256 for _, sha256 in group.files] == [
        f"{day:03}" for day in range(39, 39 - MOST_RECORDINGS, -1)
    ]
    assert group.recordings == 40


@pytest.mark.parametrize(
    ("names", "likely"),
    [
        (["measured/a.csv", "measured/b.csv"], r"([^/]+)\.\w+$"),
        (["measured/a/1.csv", "measured/b/1.csv"], r"([^/]+)/[^/]+$"),
    ],
)
def test_recordings_that_nothing_names_the_injectors_of_are_asked_about(
    names: list[str], likely: str
) -> None:
    paths = [Path(name) for name in names]
    said = doubt_of_one(paths, None, load_bench())
    assert "all 2 recordings count as those of one injector, injector_1" in said
    assert f"--injector-from '{likely}'" in said
    assert [InjectorNames(likely).of(path, load_bench()) for path in paths] == ["a", "b"]
    assert doubt_of_one(paths[:1], None, load_bench()) == doubt_of_one(paths, likely, load_bench()) == ""


def test_a_bench_that_names_its_injector_leaves_no_doubt(tmp_path: Path) -> None:
    named = load_bench(three_injectors(tmp_path, "named")).of(NAMES[0])
    assert doubt_of_one([Path("a.csv"), Path("b.csv")], None, named) == ""


def test_an_answer_is_that_of_its_recordings_model_and_healthy_ones(tmp_path: Path) -> None:
    (group,) = grouped(rows("aa", "one", [0.1]), rows("bb", "one", [0.1], day=1))
    key = group.key(("hh",))
    assert replace(group, files=group.files[::-1]).key(("hh",)) == key
    assert replace(group, files=group.files[:1]).key(("hh",)) != key
    assert group.key(()) != key
    model = tmp_path / "injector.toml"
    model.write_text(NOMINAL_INJECTOR.read_text() + "# by drawing\n")
    (other,) = kinds_of(load_bench(model=model), None)
    assert replace(group, kind=other).key(("hh",)) != key


@pytest.mark.parametrize("name", ["a/b", "..", ".", "é 7", "C:x"])
def test_any_name_of_an_injector_has_a_folder_below(name: str, tmp_path: Path) -> None:
    (group,) = grouped(rows("aa", name, [0.1]))
    place = tmp_path / group.folder
    assert place.resolve().parent == tmp_path.resolve()
    place.mkdir()


def test_injectors_of_a_bench_are_groups_of_their_own_models(tmp_path: Path) -> None:
    write_bench(tmp_path)
    bench = load_bench(tmp_path / "engine.toml")
    table = pa.concat_tables([rows("aa", "left", [0.1]), rows("aa", "right", [0.1])]).select(NEEDED)
    found = groups_of(table, {"aa": Path("aa.log")}, kinds_of(bench, None))
    assert [(each.injector, each.kind.alone.injector.name) for each in found] == [
        ("left", "left"),
        ("right", "right"),
    ]
    assert found[1].kind.file.name == "right.toml"


def test_a_pattern_cannot_name_several_injectors(tmp_path: Path) -> None:
    write_bench(tmp_path)
    with pytest.raises(UserError, match="--injector left"):
        kinds_of(load_bench(tmp_path / "engine.toml"), r"run_(\d+)")


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


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("a/injector_7_20260301_120501.csv", datetime(2026, 3, 1, 12, 5, 1, tzinfo=UTC)),
        ("2026-03-01/run.csv", datetime(2026, 3, 1, tzinfo=UTC)),
    ],
)
def test_a_path_says_when_a_recording_was_made(path: str, said: datetime) -> None:
    times = RecordingTimes(r"(\d{8}_\d{6}|\d{4}-\d\d-\d\d)")
    assert times.of(Path(path)) == said
    assert RecordingTimes(None).of(Path(path)) is None
    with pytest.raises(UserError, match="finds no date"):
        times.of(Path("a/run_99999999_999999.csv"))
    with pytest.raises(UserError, match="--time-from"):
        RecordingTimes("(")
