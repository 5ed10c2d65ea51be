"""What `check` says of time: how each message is joined and what cannot be seen of it."""

from pathlib import Path

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.check.findings import Finding, Level
from observer_rt.check.mapping import time_findings
from observer_rt.config.bench import load_bench
from tests.service.time_frames import write_time_bench
from tests.service.time_scenarios import NIBBLE, ONE_BASE, SLOW, STAMPS, TWO_BASES, slow


def findings(folder: Path, signals: dict[str, str], rate: float = 20e3) -> list[Finding]:
    return time_findings(map_bus(load_bench(write_time_bench(folder, rate, signals))))


def test_messages_of_one_base_are_fine(tmp_path: Path) -> None:
    found = findings(tmp_path, ONE_BASE)
    assert [finding.level for finding in found] == [Level.OK, Level.OK]
    assert all("index" in finding.text for finding in found)


def test_two_bases_tell_what_is_demanded_of_the_stamps(tmp_path: Path) -> None:
    found = findings(tmp_path, TWO_BASES)
    assert {finding.level for finding in found} == {Level.OK}
    assert any("2 us" in finding.text and "0.25 MPa" in finding.text for finding in found)


def test_message_without_index_and_counter_is_warned_of(tmp_path: Path) -> None:
    assert [f.level for f in findings(tmp_path, STAMPS)] == [Level.OK, Level.WARNING]
    assert [f.level for f in findings(tmp_path, NIBBLE)] == [Level.OK]


def test_slower_signal_tells_how_long_it_is_held(tmp_path: Path) -> None:
    assert any("held at most 2.5 ms" in finding.text for finding in findings(tmp_path, slow(SLOW)))
