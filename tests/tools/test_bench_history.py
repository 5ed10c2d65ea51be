"""A history: every injection is reported once, and what should not be is found."""

from dataclasses import replace
from typing import Any

import pytest

from tools.benchmarks.history import History, run_history


@pytest.fixture(scope="module")
def short() -> History:
    return run_history(0.02, 1.0, None)


def test_every_injection_is_reported_once(short: History) -> None:
    last = short.looks[-1]
    assert (last.sent, last.reported, last.out_of_turn) == (72, 72, 0)
    assert last.valid >= 68
    assert short.counters.jumps >= 71  # the pauses between the windows
    assert short.counters.lost_samples == 0


@pytest.mark.parametrize(
    "change",
    [{"reported": 71}, {"out_of_turn": 1}, {"gone_back": ("samples",)}],
)
def test_what_should_not_be_is_named(short: History, change: dict[str, Any]) -> None:
    assert not [text for text in short.missed if "memory" not in text]
    wrong = replace(short, looks=(*short.looks[:-1], replace(short.looks[-1], **change)))
    assert [text for text in wrong.missed if "memory" not in text]


def test_memory_that_grows_is_named(short: History) -> None:
    grown = replace(short, looks=tuple(replace(each, memory=400.0 + 5.0 * each.hour) for each in short.looks))
    assert any("memory grows by 5.00" in text for text in grown.missed)
