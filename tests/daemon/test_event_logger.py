"""Several injectors on one bus: an incident is told by the first, another one again."""

import pytest

from observer_rt.daemon.event_logger import TOGETHER, Deduplicator


def test_only_the_first_tells() -> None:
    once = Deduplicator()
    assert [once.is_new(who, "down") for who in ("left", "right", "third")] == [True, False, False]
    assert once.is_new("right", "back")
    assert not once.is_new("left", "back")


def test_who_says_it_again_tells_of_another_time() -> None:
    once = Deduplicator()
    once.is_new("left", "down")
    assert once.is_new("left", "down")
    assert not once.is_new("right", "down")
    assert once.is_new("right", "down")


def test_much_later_it_is_another_incident(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    once = Deduplicator()
    assert once.is_new("left", "down")
    now += 0.9 * TOGETHER
    assert not once.is_new("right", "down")
    now += 0.2 * TOGETHER
    assert once.is_new("third", "down")
