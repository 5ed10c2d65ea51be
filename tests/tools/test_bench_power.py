"""A simulated disk: what was synced is there after a cut, what was not may be torn; and who does not sync loses."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.kills.power import Disk, Operation, cut, recorded

FOLDER = "/disk"


def operation(
    kind: str, fd: int = 3, offset: int = 0, data: bytes = b"", path: str = "", to: str = ""
) -> Operation:
    return Operation(kind, fd, offset, data, path, to)


def left(operations: list[Operation], folder: Path, cuts: int = 60) -> set[bytes | None]:
    """What may be in the file `a` after them; None: it is not there."""
    disk, found = Disk(Path(FOLDER)), set()
    for each in operations:
        disk.do(each)
    for number in range(cuts):
        target = folder / str(number)
        target.mkdir()
        disk.cut(target, np.random.default_rng(number))
        file = target / "a"
        found.add(file.read_bytes() if file.exists() else None)
    return found


OPENED = operation("create", path=f"{FOLDER}/a")
WRITTEN = operation("write", data=b"12345678")
NAMED = [operation("open", fd=4, path=FOLDER), operation("sync", fd=4)]


def test_what_was_synced_with_its_name_is_there(tmp_path: Path) -> None:
    assert left([OPENED, WRITTEN, operation("sync"), *NAMED], tmp_path) == {b"12345678"}


def test_what_was_not_synced_may_be_there_or_torn_or_not(tmp_path: Path) -> None:
    found = left([OPENED, WRITTEN, *NAMED], tmp_path)
    assert {b"", b"12345678"} < found
    assert any(each and len(each) < 8 for each in found)


def test_a_name_that_was_not_synced_may_be_gone(tmp_path: Path) -> None:
    assert left([OPENED, WRITTEN, operation("sync")], tmp_path) == {None, b"12345678"}


def test_a_file_that_takes_the_place_of_another_is_the_old_or_the_new_one(tmp_path: Path) -> None:
    new = [
        operation("create", fd=5, path=f"{FOLDER}/a.new"),
        operation("write", fd=5, data=b"new"),
        operation("sync", fd=5),
        operation("rename", path=f"{FOLDER}/a.new", to=f"{FOLDER}/a"),
    ]
    assert left([OPENED, WRITTEN, operation("sync"), *NAMED, *new], tmp_path) == {b"12345678", b"new"}


@pytest.mark.slow
def test_state_and_journal_are_there_after_any_cut_and_would_not_be_without_syncing(tmp_path: Path) -> None:
    found = recorded(tmp_path)
    assert not [each for each in cut(found, 60, 1, tmp_path) if each.lost or each.problems]
    for each in tmp_path.glob("cut*"):
        shutil.rmtree(each)
    careless = [each for each in found if each.kind != "sync"]
    assert [each for each in cut(careless, 60, 1, tmp_path) if each.lost or each.problems]
