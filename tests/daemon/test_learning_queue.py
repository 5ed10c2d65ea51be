"""The queue of what is to be learned: one thread, an event of each injector in turn."""

import threading
from concurrent.futures import CancelledError

import pytest

from observer_rt.daemon.side_by_side import LearningQueue


def test_an_injector_with_many_events_does_not_keep_the_others_waiting() -> None:
    queue = LearningQueue()
    busy, quiet, calm = (queue.share() for _ in range(3))
    held = threading.Event()
    done: list[str] = []
    first = busy.submit(held.wait)
    for number in range(4):
        busy.submit(done.append, f"busy {number}")
    for number in range(2):
        quiet.submit(done.append, f"quiet {number}")
    last = calm.submit(done.append, "calm 0")
    held.set()
    assert first.result(10.0)
    last.result(10.0)
    busy.submit(lambda: None).result(10.0)
    assert done == ["quiet 0", "calm 0", "busy 0", "quiet 1", "busy 1", "busy 2", "busy 3"]
    queue.close()


def test_one_that_leaves_gives_up_its_own_only() -> None:
    queue = LearningQueue()
    leaving, staying = queue.share(), queue.share()
    held = threading.Event()
    leaving.submit(held.wait)
    given_up = leaving.submit(int)
    kept = staying.submit(int, "7")
    leaving.shutdown(cancel_futures=True)
    held.set()
    assert kept.result(10.0) == 7
    with pytest.raises(CancelledError):
        given_up.result(10.0)
    queue.close()


def test_a_failure_is_whose_job_it_was() -> None:
    queue = LearningQueue()
    share = queue.share()
    with pytest.raises(ValueError, match="invalid literal"):
        share.submit(int, "seven").result(10.0)
    assert share.submit(int, "7").result(10.0) == 7
    queue.close()
