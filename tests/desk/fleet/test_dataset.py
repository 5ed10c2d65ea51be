"""The folder of a batch: whole whenever it is looked at, and nothing in it twice."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.desk.fleet.dataset import Dataset, read_injections
from observer_rt.desk.fleet.job import FailedFile
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
    result = read_injections(tmp_path)
    assert result.equals(rows("aa", "one", [0.1, 0.2]).select(result.schema.names))


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


@pytest.mark.parametrize(("name", "text"), [("done.jsonl", ""), ("batch.json", "{"), ("batch.json", "[]")])
def test_a_folder_of_something_else_is_left_alone(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=name):
        Dataset(tmp_path, SETTINGS)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, text)]


def test_failures_are_those_of_the_last_run(tmp_path: Path) -> None:
    dataset = Dataset(tmp_path, SETTINGS)
    for name in ("a", "b"):
        dataset.take_failure(FailedFile(Path(name), "cc", f"{name}: is empty"))
    lines = (tmp_path / "errors.jsonl").read_text().splitlines()
    assert [json.loads(line) for line in lines] == [
        {"file": name, "sha256": "cc", "problem": f"{name}: is empty"} for name in ("a", "b")
    ]
    Dataset(tmp_path, SETTINGS)
    assert not (tmp_path / "errors.jsonl").exists()


def test_another_folder_than_that_of_a_batch_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="observer-rt batch"):
        read_injections(tmp_path)


@given(name=st.text(min_size=1, max_size=20).filter(lambda text: text.isprintable()))
def test_any_name_of_an_injector_comes_back(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    folder = tmp_path_factory.mktemp("names")
    Dataset(folder, SETTINGS).take(Path("x.csv"), "aa", rows("aa", name, [0.1]))
    assert read_injections(folder)["injector"].to_pylist() == [name]
