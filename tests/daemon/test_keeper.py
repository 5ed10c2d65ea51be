"""The learned state follows the daemon, at a bounded rate, and trouble with the disk is reported once."""

import errno
import os
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector_sections import StateConfig
from observer_rt.daemon.keeper import Keeper, keeper_of
from observer_rt.daemon.state_file import load_knowledge
from observer_rt.foundation.errors import RunError
from tests.daemon.participants import until
from tests.daemon.samples import some_knowledge

INTERVAL = 0.25  # s, between two writes


@pytest.fixture
def bench() -> Bench:
    return load_bench().with_sections(state=StateConfig(save_within_s=2 * INTERVAL))


class Kept:
    def __init__(self, bench: Bench, folder: Path) -> None:
        self.bench, self.path = bench, folder / "state.json"
        self.knowledge = some_knowledge(events=1)
        self.messages: list[str] = []

    @contextmanager
    def kept(self) -> Iterator[Keeper]:
        files = keeper_of(self.bench, self.path, None, self.messages.append)
        with files as keeper, keeper.keeping(lambda: self.knowledge):
            yield keeper

    def learn(self, events: int) -> None:
        self.knowledge = some_knowledge(events, events=events)
        until(lambda: self.events() == events)

    def events(self) -> int:
        """Events of the state in the file now; fails if that is damaged."""
        knowledge = load_knowledge(self.path, self.bench.injector.parameters, set_aside=False).knowledge
        return knowledge.state.events if knowledge else 0


@pytest.fixture
def learner(bench: Bench, tmp_path: Path) -> Kept:
    return Kept(bench, tmp_path)


def test_the_last_save_is_made_whether_or_not_anything_was_learned(learner: Kept) -> None:
    with learner.kept():
        time.sleep(2 * INTERVAL)
        assert not learner.path.exists()
    assert learner.events() == 1


def test_saves_are_no_more_frequent_than_stated(learner: Kept) -> None:
    files = set()
    with learner.kept():
        began = time.monotonic()
        for count in range(2, 400):
            learner.knowledge = some_knowledge(events=count)
            time.sleep(0.002)
            if learner.path.exists():
                files.add(learner.path.stat().st_mtime_ns)
        lasted = time.monotonic() - began
    assert 2 <= len(files) <= lasted / INTERVAL + 1


def test_a_full_disk_is_told_once_counted_and_tried_again(learner: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    is_full, tries, fsync = threading.Event(), list[int](), os.fsync

    def limited(descriptor: int) -> None:
        if is_full.is_set():
            tries.append(descriptor)
            raise OSError(errno.ENOSPC, "No space left on device")
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", limited)
    with learner.kept() as keeper:
        learner.learn(2)
        is_full.set()
        learner.knowledge = some_knowledge(events=3)
        until(lambda: len(tries) >= 4)
        assert len(learner.messages) == 1
        assert len(tries) - 1 <= keeper.failures <= len(tries)
        assert re.search(r"No space left on device\n  remedy: make room there.* every 0.25 s", learner.messages[0])
        assert learner.events() == 2  # the old file is whole
        is_full.clear()
        until(lambda: learner.events() == 3)
        until(lambda: len(learner.messages) == 2)
        assert re.fullmatch(r"learned state in .* is written again, after \d+ failed attempts", learner.messages[1])
    assert re.fullmatch(r"learned state saved in .* \(\d+ attempts failed before\)", learner.messages[2])


def test_what_cannot_be_true_is_not_blamed_on_the_disk(learner: Kept) -> None:
    good = learner.knowledge
    with learner.kept():
        belief = good.state.learned.belief
        belief = replace(belief, mean=np.full_like(belief.mean, 1e3))
        learner.knowledge = replace(good, state=good.state.map(lambda each: replace(each, belief=belief)))
        until(lambda: bool(learner.messages))
        learner.learn(2)
    assert "the mean lies beyond what an injector can do\n  remedy: check the sensors" in learner.messages[0]
    assert "make room" not in learner.messages[0]


def test_a_disk_that_is_full_at_the_end_is_an_error(learner: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RunError, match="No space left"), learner.kept():
        monkeypatch.setattr(os, "fsync", Mock(side_effect=OSError(errno.ENOSPC, "No space left on device")))


def test_the_bench_file_names_what_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(load_bench().path.read_text().replace('# file = "learned.json"', 'file = "mine.json"'))
    with keeper_of(load_bench(path), None, None, print) as keeper:
        assert keeper.state == tmp_path / "mine.json"
        assert (tmp_path / "mine.json.lock").exists()
    with keeper_of(load_bench(path), tmp_path / "other.json", None, print) as keeper:
        assert keeper.state == tmp_path / "other.json"


def test_nothing_is_kept_unasked(bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with keeper_of(bench, None, None, print) as keeper, keeper.keeping(some_knowledge):
        time.sleep(2 * INTERVAL)
    assert not list(tmp_path.iterdir())
