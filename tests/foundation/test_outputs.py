"""Files that are replaced: whole, in the same place, with the same rights; a failure leaves the old one."""

from pathlib import Path

import pytest

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import replacing, write_text
from observer_rt.foundation.outputs import check_output


def test_rights_and_links_stay(tmp_path: Path) -> None:
    target, link = tmp_path / "a.txt", tmp_path / "b.txt"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink()
    assert (target.read_text(), target.stat().st_mode & 0o777) == ("new", 0o640)


def test_a_failure_leaves_the_old_file_and_nothing_beside(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")

    def fail() -> None:
        with replacing(target) as part:
            part.write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.txt", "old")]


def test_what_is_no_file_is_never_replaced() -> None:
    with pytest.raises(UserError, match=r"^--save-state /dev/null: is no file(\n|$)"):
        check_output("--save-state", Path("/dev/null"), force=True)
