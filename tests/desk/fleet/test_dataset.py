"""The folder of a batch: whole whenever it is looked at, and nothing in it twice."""

from pathlib import Path

import pytest

from observer_rt.desk.fleet.batch import Dataset, read_injections
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import rows

SETTINGS = {"bench": "a", "learning": True}


def test_what_was_taken_is_there_for_the_next_run_and_once(tmp_path: Path) -> None:
    first = Dataset(tmp_path, SETTINGS)
    first.take("aa", rows("aa", "one", [0.1, 0.2]))
    first.take("bb", rows("bb", "two", []))
    again = Dataset(tmp_path, SETTINGS)
    assert [again.is_done(sha256) for sha256 in ("aa", "bb", "cc")] == [True, True, False]
    again.take("aa", rows("aa", "one", [0.1, 0.2]))
    assert read_injections(tmp_path).equals(rows("aa", "one", [0.1, 0.2]))


def test_another_model_needs_another_folder(tmp_path: Path) -> None:
    Dataset(tmp_path, SETTINGS)
    with pytest.raises(UserError, match="learning"):
        Dataset(tmp_path, {**SETTINGS, "learning": False})


@pytest.mark.parametrize(("name", "text"), [("injections", ""), ("batch.json", "{"), ("batch.json", "[]")])
def test_a_folder_of_something_else_is_left_alone(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=name):
        Dataset(tmp_path, SETTINGS)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, text)]


def test_another_folder_than_that_of_a_batch_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="observer-rt batch"):
        read_injections(tmp_path)
