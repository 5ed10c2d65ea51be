"""The folder of a batch: whole whenever it is looked at, and nothing in it twice."""

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.desk.fleet.dataset import Dataset, read_injections
from observer_rt.desk.fleet.job import OLD_NAMES, SCHEMA, FailedFile
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import rows

SETTINGS = {"bench": "a", "learning": True}


def test_what_was_taken_is_there_for_the_next_run(tmp_path: Path) -> None:
    first = Dataset(tmp_path, SETTINGS)
    first.take(Path("x.csv"), "aa", rows("aa", "one", [0.1, 0.2]))
    first.take(Path("y.csv"), "bb", rows("bb", "two", []))

    again = Dataset(tmp_path, SETTINGS)
    assert again.is_done("aa")
    assert again.is_done("bb")
    assert not again.is_done("cc")
    found = read_injections(tmp_path)
    assert found.equals(rows("aa", "one", [0.1, 0.2]).select(found.schema.names))


def test_a_file_done_twice_is_there_once(tmp_path: Path) -> None:
    """Power failed between its rows and the note that it is done."""
    Dataset(tmp_path, SETTINGS).take(Path("x.csv"), "aa", rows("aa", "one", [0.1]))
    (tmp_path / "done.jsonl").write_text('{"sha256": "aa", "fi')
    again = Dataset(tmp_path, SETTINGS)
    assert not again.is_done("aa")
    again.take(Path("x.csv"), "aa", rows("aa", "one", [0.1]))
    assert read_injections(tmp_path).num_rows == 1
    assert Dataset(tmp_path, SETTINGS).is_done("aa")


def test_another_model_needs_another_folder(tmp_path: Path) -> None:
    Dataset(tmp_path, SETTINGS)
    with pytest.raises(UserError, match="learning"):
        Dataset(tmp_path, {**SETTINGS, "learning": False})


def test_failures_are_a_table_of_the_last_run(tmp_path: Path) -> None:
    with Dataset(tmp_path, SETTINGS) as dataset:
        dataset.take_failures([FailedFile(Path("bad.csv"), "cc", "bad.csv: is empty")])
        dataset.take_failures([FailedFile(None, "", "no answer", "left")])
    table = pq.read_table(tmp_path / "errors.parquet").to_pylist()
    assert table == [
        {"file": "bad.csv", "sha256": "cc", "injector": None, "problem": "bad.csv: is empty"},
        {"file": None, "sha256": "", "injector": "left", "problem": "no answer"},
    ]
    assert not (tmp_path / "errors.jsonl").exists()
    with Dataset(tmp_path, SETTINGS):
        pass
    assert not (tmp_path / "errors.parquet").exists()


def test_failures_are_there_while_a_batch_runs_and_when_it_is_interrupted(tmp_path: Path) -> None:
    def run() -> None:
        with Dataset(tmp_path, SETTINGS) as dataset:
            for name in ("a", "b"):
                dataset.take_failures([FailedFile(Path(name), "", f"{name}: is empty")])
            lines = (tmp_path / "errors.jsonl").read_text().splitlines()
            assert [json.loads(line)["file"] for line in lines] == ["a", "b"]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run()
    assert pq.read_table(tmp_path / "errors.parquet")["file"].to_pylist() == ["a", "b"]


def test_a_failure_costs_the_same_however_many_there_were(tmp_path: Path) -> None:
    written = []
    with Dataset(tmp_path, SETTINGS) as dataset:
        for number in range(200):
            before = {path: path.stat().st_size for path in tmp_path.iterdir()}
            dataset.take_failures([FailedFile(Path(f"{number:03}.csv"), "", "is empty")])
            written.append(sum(path.stat().st_size - before.get(path, 0) for path in tmp_path.iterdir()))
            assert all(path.stat().st_size >= size for path, size in before.items())
    assert len(set(written)) == 1


def test_columns_of_an_older_version_are_read_under_their_names_of_today(tmp_path: Path) -> None:
    today = rows("aa", "one", [0.1, 0.2])
    before = today.rename_columns([OLD_NAMES.get(name, name) for name in today.column_names])
    Dataset(tmp_path, SETTINGS).take(Path("x.csv"), "aa", before)
    Dataset(tmp_path, SETTINGS).take(Path("y.csv"), "bb", rows("bb", "one", [0.3]))
    found = read_injections(tmp_path)
    assert sorted(found["nozzle_v_H_ci95_low"].to_pylist()) == pytest.approx([0.0804, 0.1804, 0.2804])
    assert found.schema.names == SCHEMA.names


def test_a_folder_that_is_none_of_a_batch_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="observer-rt batch"):
        read_injections(tmp_path)


@given(name=st.text(min_size=1, max_size=20).filter(lambda text: text.isprintable()))
def test_any_name_of_an_injector_comes_back(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    folder = tmp_path_factory.mktemp("names")
    Dataset(folder, SETTINGS).take(Path("x.csv"), "aa", rows("aa", name, [0.1]))
    assert read_injections(folder)["injector"].to_pylist() == [name]
