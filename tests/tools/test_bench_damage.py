"""The campaign of damaged files: a share of it, and that it sees what it looks for."""

import json
from collections.abc import Iterator
from itertools import count, islice

import pytest

from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.candump import CandumpLog
from observer_rt.files.formats import log_formats, signal_formats, suffixes_of, written
from observer_rt.files.mdf4.can_log import Mdf4Log
from tools.benchmarks import damage
from tools.benchmarks.damage import (
    Became,
    Task,
    damage_document,
    damage_table,
    faults_of,
    one_file,
    run_damage,
)
from tools.benchmarks.damage_files import FRAMES

SEED = 7


@pytest.mark.slow
def test_a_share_of_the_campaign_has_no_fault() -> None:
    outcomes = run_damage(150, SEED, 1)
    assert faults_of(outcomes) == []
    kinds = {each.task.kind for each in outcomes}
    assert {kind[kind.index(".") :] for kind in kinds} >= {
        *suffixes_of(written(log_formats())),
        *suffixes_of(written(signal_formats())),
    }
    assert damage_table(outcomes).row_count == len(kinds) + 1
    assert json.loads(json.dumps(damage_document(outcomes)))["figures"]["files"] == 150


def test_the_same_seed_gives_the_same_outcome() -> None:
    outcomes = [one_file(Task("frames.log", SEED, number)) for number in range(30)]
    again = [one_file(Task("frames.log", SEED, number)) for number in range(30)]
    assert [each.became for each in outcomes] == [each.became for each in again]
    assert len({each.became for each in outcomes}) > 1


@pytest.mark.parametrize("misdeed", [lambda: 1 // 0, lambda: print("a word"), lambda: exit(3)])
def test_what_a_reader_must_not_do_is_a_fault(monkeypatch: pytest.MonkeyPatch, misdeed: object) -> None:
    assert callable(misdeed)
    entries = CandumpLog._entries

    def badly(self: CandumpLog) -> object:
        misdeed()
        return entries(self)

    damage._whole_content("frames.log", ".log")
    monkeypatch.setattr(CandumpLog, "_entries", badly)
    assert one_file(Task("frames.log", SEED, 4)).became is Became.FAULT


def test_frames_of_a_loggers_file_that_are_lost_in_silence_are_a_fault(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    entries = Mdf4Log._entries

    def half(self: Mdf4Log) -> Iterator[tuple[int, LogFrame]]:
        return islice(entries(self), FRAMES // 2)

    tasks = (Task("card.mf4", SEED, number) for number in count())
    harmless = next(task for task in tasks if one_file(task).became is Became.SAME)
    monkeypatch.setattr(Mdf4Log, "_entries", half)
    found = one_file(harmless)
    assert (found.became, found.said) == (
        Became.FAULT,
        f"{FRAMES // 2} of {FRAMES} frames are lost, nothing told",
    )
