"""What `check` says of several buses: each by itself."""

from pathlib import Path

import pytest

from observer_rt.bus.can_frame import frame_time
from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import load_bench
from observer_rt.desk.check.bench_rules import checkup
from observer_rt.desk.check.buses import buses_findings, expected_load
from observer_rt.desk.check.findings import Finding, Level
from tests.benches import twin_bench

THREE = (Path(__file__).parents[2] / "bus" / "databases" / "three_buses.toml").read_text()


def findings_of(path: Path) -> list[Finding]:
    bench = load_bench(path)
    return buses_findings(bench, map_bench(bench))


def changed(folder: Path, old: str, new: str) -> Path:
    assert old in THREE
    path = folder / "bench.toml"
    path.write_text(THREE.replace(old, new))
    return path


def test_equal_identifiers_on_different_buses_are_no_clash(tmp_path: Path) -> None:
    findings = findings_of(twin_bench(tmp_path))
    assert [f.text for f in findings if f.topic == "identifiers"] == ["6 messages, all different"]
    assert not [f for f in findings if f.level is Level.ERROR]


def test_a_bus_that_carries_nothing_is_told(tmp_path: Path) -> None:
    findings = findings_of(changed(tmp_path, '[outputs]\nlink = "results"\n', ""))
    (warning,) = (f for f in findings if f.topic == "buses" and f.level is Level.WARNING)
    assert "results (can3), socketcan: nothing" in warning.text
    assert "leave [links.results] out" in warning.text


def test_the_load_of_each_bus_is_its_own(tmp_path: Path) -> None:
    path = changed(tmp_path, 'channel = "can2"', 'channel = "can2"\nbit_rate = 500e3\ndata_bit_rate = 2e6')
    bench = load_bench(path)
    bus = map_bench(bench)
    loads = [expected_load(bench, bus, number).continuous for number in range(4)]
    frames_per_second = 100e3 / 28
    assert loads[:2] == pytest.approx([frames_per_second * frame_time(64, True, 1e6, 8e6, False)] * 2)
    assert loads[2] == pytest.approx(frames_per_second * frame_time(64, True, 500e3, 2e6, False))
    assert loads[3] > loads[0]  # summary and status besides the rates
    errors = [f.text for f in findings_of(path) if f.level is not Level.OK]
    assert all("line (can2)" in text for text in errors)
    assert errors


def test_every_interface_is_looked_at(tmp_path: Path) -> None:
    path = changed(tmp_path, 'channel = "can1"', 'channel = "can_x1"')
    findings = [f.text for f in checkup(load_bench(path)) if f.topic == "interface"]
    for name in ("can0", "can_x1", "can2", "can3"):
        assert any(text.startswith(f"{name} ") or text.startswith(f"{name}:") for text in findings)


def test_stamps_of_drivers_are_too_rough_beside_other_buses(tmp_path: Path) -> None:
    by_stamps = 'link = "lift"\ntime_base = "other"'
    path = changed(tmp_path, 'channel = "can1"', 'channel = "can1"\ninterface = "pcan"')
    assert not [f for f in findings_of(path) if "stamped" in f.text]  # one time base, all with an index
    path.write_text(path.read_text().replace('link = "lift"', by_stamps))
    (warning,) = (f for f in findings_of(path) if "stamped" in f.text)
    assert (warning.level, warning.text.partition(":")[0]) == (Level.WARNING, "lift (can1)")
    path.write_text(THREE.replace('link = "lift"', by_stamps))
    assert not [f for f in findings_of(path) if "stamped" in f.text]
