"""The learned state follows the daemon, at a bounded rate, and trouble with the disk is told once."""

import errno
import os
import re
import threading
import time
from pathlib import Path

import pytest

from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector import LearningConfig, StateConfig, Training
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.service.keeping.keeper import keeper_of
from observer_rt.service.keeping.state_file import load_knowledge, model_hash
from tests.service.knowledge_samples import some_knowledge
from tests.service.participants import until

INTERVAL = 0.25  # s, between two writes


class Learner:
    """Knows what the test says."""

    def __init__(self) -> None:
        self.knowledge = some_knowledge(events=1)

    def source(self) -> Knowledge:
        """What it knows now."""
        return self.knowledge


@pytest.fixture
def bench() -> Bench:
    return load_bench().with_sections(state=StateConfig(save_within_s=2 * INTERVAL))


def saved(bench: Bench, path: Path) -> Knowledge | None:
    """What is restored from the file now; fails if it is damaged."""
    return load_knowledge(path, model_hash(bench.injector.parameters), set_aside=False).knowledge


def events(bench: Bench, path: Path) -> int:
    knowledge = saved(bench, path)
    return 0 if knowledge is None else knowledge.events


def test_what_is_learned_is_saved_while_running(bench: Bench, tmp_path: Path) -> None:
    path, learner, told = tmp_path / "state.json", Learner(), list[str]()
    with keeper_of(bench, path, None, told.append) as keeper, keeper.keeping(learner.source):
        assert keeper.state == path
        for count in range(2, 5):
            learner.knowledge = some_knowledge(count, events=count)
            until(lambda: events(bench, path) == learner.knowledge.events)
    assert told[-1] == f"learned state saved in {path}"
    assert [entry.name for entry in tmp_path.iterdir()] == ["state.json"]


def test_the_last_save_is_made_whether_or_not_anything_was_learned(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    with keeper_of(bench, path, None, print) as keeper, keeper.keeping(Learner().source):
        time.sleep(2 * INTERVAL)
        assert not path.exists()
    assert events(bench, path) == 1


def test_saves_are_no_more_frequent_than_stated(bench: Bench, tmp_path: Path) -> None:
    path, learner, files = tmp_path / "state.json", Learner(), set()
    with keeper_of(bench, path, None, print) as keeper, keeper.keeping(learner.source):
        began = time.monotonic()
        for count in range(2, 400):
            learner.knowledge = some_knowledge(events=count)
            time.sleep(0.002)
            if path.exists():
                files.add(path.stat().st_mtime_ns)
        lasted = time.monotonic() - began
    assert 2 <= len(files) <= lasted / INTERVAL + 1


def test_a_full_disk_is_told_once_counted_and_tried_again(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, learner, told = tmp_path / "state.json", Learner(), list[str]()

    def tell(text: str) -> None:
        if "it took" not in text:  # a busy machine
            told.append(text)

    is_full, tries, fsync = threading.Event(), list[int](), os.fsync

    def limited(descriptor: int) -> None:
        if is_full.is_set():
            tries.append(descriptor)
            raise OSError(errno.ENOSPC, "No space left on device")
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", limited)
    with keeper_of(bench, path, None, tell) as keeper, keeper.keeping(learner.source):
        learner.knowledge = some_knowledge(events=2)
        until(lambda: events(bench, path) == 2)
        is_full.set()
        learner.knowledge = some_knowledge(events=3)
        until(lambda: len(tries) >= 4)
        assert len(told) == 1
        assert len(tries) - 1 <= keeper.failures <= len(tries)
        assert re.search(r"No space left on device\n  remedy: make room there.* every 0.25 s", told[0])
        assert events(bench, path) == 2  # the old file is whole
        is_full.clear()
        until(lambda: events(bench, path) == 3)
        until(lambda: len(told) == 2)
        assert re.fullmatch(r"learned state in .* is written again, after \d+ failed attempts", told[1])
    assert re.fullmatch(r"learned state saved in .* \(\d+ attempts failed before\)", told[2])


def test_a_disk_too_slow_for_what_is_stated_is_told_once(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, learner, told = tmp_path / "state.json", Learner(), list[str]()
    monkeypatch.setattr(os, "fsync", lambda _: time.sleep(INTERVAL))
    with keeper_of(bench, path, None, told.append) as keeper, keeper.keeping(learner.source):
        for count in range(2, 5):
            learner.knowledge = some_knowledge(count, events=count)
            until(lambda: events(bench, path) == learner.knowledge.events)
        until(lambda: bool(told))
    assert len(told) == 2
    assert re.match(r"warning: it took \d\.\d s to write what is kept: a kill may cost more", told[0])


def test_a_disk_that_is_full_at_the_end_is_an_error(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with (
        keeper_of(bench, tmp_path / "state.json", None, print) as keeper,
        pytest.raises(RunError, match="No space left"),
        keeper.keeping(Learner().source),
    ):
        monkeypatch.setattr(os, "fsync", full)


def test_a_state_belongs_to_one_daemon(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    with (
        keeper_of(bench, path, None, print),
        pytest.raises(UserError, match=f"state.json: is in use by process {os.getpid()}"),
    ):
        keeper_of(bench, path, None, print).__enter__()


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
    with keeper_of(bench, None, None, print) as keeper, keeper.keeping(Learner().source):
        time.sleep(2 * INTERVAL)
    assert not list(tmp_path.iterdir())


def test_a_training_that_keeps_nothing_refuses(bench: Bench, tmp_path: Path) -> None:
    paper = bench.with_sections(learning=LearningConfig(training=Training.PAPER, identification_gain=1e5))
    with pytest.raises(UserError, match="keeps nothing"):
        keeper_of(paper, tmp_path / "state.json", None, print).__enter__()
