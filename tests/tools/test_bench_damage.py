"""The fuzz of damaged files: a share of it, and that it sees what it looks for."""

import pytest

from observer_rt.files.canlog.candump import CandumpLog
from tools.benchmarks import damage
from tools.benchmarks.damage import Became, kinds, one_file, run_damage


@pytest.mark.slow
def test_a_share_of_the_campaign_has_no_fault() -> None:
    outcomes = run_damage(60, 7)
    assert [each for each in outcomes if each.became is Became.FAULT] == []
    assert {each.kind for each in outcomes} == set(kinds())
    assert {Became.REFUSED, Became.TOLD, Became.SAME} <= {each.became for each in outcomes}


@pytest.mark.parametrize("misdeed", [lambda: 1 // 0, lambda: print("a word"), lambda: exit(3)])
def test_what_a_reader_must_not_do_is_a_fault(monkeypatch: pytest.MonkeyPatch, misdeed: object) -> None:
    assert callable(misdeed)
    entries = CandumpLog._entries

    def badly(self: CandumpLog) -> object:
        misdeed()
        return entries(self)

    damage._whole_content("frames.log", "out.log")
    monkeypatch.setattr(CandumpLog, "_entries", badly)
    assert one_file("frames.log", 7, 4).became is Became.FAULT
