"""The fuzz of damaged files: a share of it, and that it sees what it looks for."""

import pytest

from observer_rt.files.canlog.candump import CandumpLog
from tools.benchmarks import damage
from tools.benchmarks.damage import Became, convert_damaged, kinds


@pytest.mark.slow
def test_a_share_of_the_campaign_has_no_fault() -> None:
    names = kinds()
    rows = [convert_damaged(names[number % len(names)], 7, number) for number in range(60)]
    assert [row for row in rows if row["became"] is Became.FAULT] == []
    assert {Became.REFUSED, Became.TOLD, Became.SAME} <= {row["became"] for row in rows}


@pytest.mark.parametrize("misdeed", [lambda: 1 // 0, lambda: print("a word"), lambda: exit(3)])
def test_what_a_reader_must_not_do_is_a_fault(monkeypatch: pytest.MonkeyPatch, misdeed: object) -> None:
    assert callable(misdeed)
    entries = CandumpLog._entries

    def badly(self: CandumpLog) -> object:
        misdeed()
        return entries(self)

    damage._whole_content("frames.log", "out.log")
    monkeypatch.setattr(CandumpLog, "_entries", badly)
    assert convert_damaged("frames.log", 7, 4)["became"] is Became.FAULT
