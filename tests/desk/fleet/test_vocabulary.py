"""Workers serve one command after another: each has its own effects, and no others."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.config.own_effects import OwnEffects, use_effects
from observer_rt.foundation.errors import UserError
from observer_rt.model.effects import VOCABULARY
from tests.pages import Page


@pytest.fixture
def own(tmp_path: Path) -> Iterator[OwnEffects]:
    path = tmp_path / "my_effects.py"
    path.write_text(Page("docs/effects.md").fenced("python")[0])
    use_effects([path])
    own = OwnEffects.in_use([path])
    use_effects([])
    yield own
    use_effects([])


def test_each_command_has_its_own(own: OwnEffects) -> None:
    none = OwnEffects.in_use([])
    for _ in range(2):
        own.use()
        assert "sac_volume" in VOCABULARY
        none.use()
        assert "sac_volume" not in VOCABULARY


def test_another_file_at_the_worker_is_refused(own: OwnEffects) -> None:
    with pytest.raises(UserError, match="worker: has other effects"):
        replace(own, digests=("0" * 64,)).use()


def test_a_file_that_changed_meanwhile_is_refused(own: OwnEffects) -> None:
    (path,) = own.paths
    path.write_text(path.read_text() + "# changed\n")
    with pytest.raises(UserError, match="same files"):
        own.use()
