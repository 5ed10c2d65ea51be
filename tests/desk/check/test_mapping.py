"""What `check` says of the mapping: how each message is joined, what cannot be seen of it; delays and lags."""

from pathlib import Path

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from observer_rt.desk.check.findings import Finding, Level
from observer_rt.desk.check.injector import channel_findings, time_findings
from tests.benches import bench_with
from tests.daemon.time_frames import write_time_bench
from tests.daemon.time_scenarios import NIBBLE, SLOW, STAMPS, TWO_BASES, slow


def findings(folder: Path, signals: dict[str, str], rate: float = 20e3) -> list[Finding]:
    return time_findings(map_bus(load_bench(write_time_bench(folder, rate, signals))))


def test_two_bases_tell_what_is_demanded_of_the_stamps(tmp_path: Path) -> None:
    result = findings(tmp_path, TWO_BASES)
    assert {finding.level for finding in result} == {Level.OK}
    assert any("2 us" in finding.text and "0.25 MPa" in finding.text for finding in result)


def test_message_without_index_and_counter_is_warned_of(tmp_path: Path) -> None:
    assert [f.level for f in findings(tmp_path, STAMPS)] == [Level.OK, Level.WARNING]
    assert [f.level for f in findings(tmp_path, NIBBLE)] == [Level.OK]


def test_slower_signal_tells_how_long_it_is_held(tmp_path: Path) -> None:
    assert any("held at most 2.5 ms" in finding.text for finding in findings(tmp_path, slow(SLOW)))


def test_what_is_stated_is_said_channel_by_channel() -> None:
    bench = bench_with(
        line_pressure={"filter_delay_us": 22.5}, needle_lift={"filter_delay_us": 4, "lag_us": 15.9}
    )
    findings = channel_findings(bench.injector)
    assert {each.level for each in findings} == {Level.OK}
    assert [each.text.split(":")[0] for each in findings] == [Role.NEEDLE_LIFT, Role.LINE_PRESSURE]
    assert "4 us late" in findings[0].text
    assert "lag of 15.9 us" in findings[0].text
    assert "22.5 us late" in findings[1].text
    assert "lag" not in findings[1].text
