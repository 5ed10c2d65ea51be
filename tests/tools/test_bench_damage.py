"""The campaign of damaged files: a share of it, and that it sees what it looks for."""

import json

import pytest
from rich.console import Console

from observer_rt.recording.canlog.candump import CandumpLog
from observer_rt.recording.formats import log_formats, signal_formats, suffixes_of, written
from tools.benchmarks import damage
from tools.benchmarks.damage import Became, Task, damage_document, damage_table, one_file, run_damage

SEED = 7


@pytest.mark.slow
def test_a_share_of_the_campaign_has_no_fault() -> None:
    campaign = run_damage(150, SEED, 1, Console(quiet=True))
    assert campaign.faults == []
    kinds = {each.task.kind for each in campaign.outcomes}
    assert {kind[kind.index(".") :] for kind in kinds} >= {
        *suffixes_of(written(log_formats())),
        *suffixes_of(written(signal_formats())),
    }
    assert damage_table(campaign).row_count == len(kinds) + 1
    assert json.loads(json.dumps(damage_document(campaign)))["figures"]["files"] == 150


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
