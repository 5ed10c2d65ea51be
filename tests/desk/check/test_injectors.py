"""What `check` says of several injectors, each by itself, and of the mapping of one."""

from pathlib import Path

import pytest

from observer_rt.bus.can_frame import frame_time
from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.config.bench import load_bench
from observer_rt.desk.check.bench_rules import checkup
from observer_rt.desk.check.buses import expected_load
from observer_rt.desk.check.findings import Finding, Level
from observer_rt.desk.check.injector import time_findings
from observer_rt.foundation.errors import UserError
from tests.daemon.time_frames import write_time_bench
from tests.daemon.time_scenarios import NIBBLE, SLOW, STAMPS, TWO_BASES, slow
from tests.two_injectors import one_injector, two_injectors


def errors(findings: list[Finding]) -> list[str]:
    return [finding.text for finding in findings if finding.level is Level.ERROR]


def test_each_is_reported_by_its_name(tmp_path: Path) -> None:
    two = checkup(load_bench(two_injectors(tmp_path)))
    for number, name in enumerate(("left", "right"), 1):
        alone = checkup(load_bench(one_injector(tmp_path, name, number)))
        for topic in ("mapping", "sampling", "integration", "dead band", "events", "time", "injector"):
            texts = [finding.text for finding in two if finding.topic == topic]
            said = [f"{name}: {finding.text}" for finding in alone if finding.topic == topic]
            assert said == [text for text in texts if text.startswith(f"{name}: ")], topic
            assert said, topic
    assert [finding.text for finding in two if finding.topic == "identifiers"] == ["11 messages, all different"]
    assert not errors([finding for finding in two if finding.topic != "interface"])


def test_a_shared_message_loads_its_bus_once(tmp_path: Path) -> None:
    bench = load_bench(two_injectors(tmp_path))
    loads = [expected_load(bench, map_bench(bench), number).continuous for number in range(3)]
    frame, blocks = frame_time(64, True, 500e3, 5e6, False), 100e3 / 28
    results = 10 + 17  # states and summaries a second, each in one frame, if a shorter one
    assert loads[0] == pytest.approx(frame * blocks)
    assert loads[1] == loads[2] == pytest.approx(frame * (3 * blocks + results), abs=0.15 * frame * results)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('link = "right"\ninjector_id', 'link = "left"\ninjector_id', "the message InjectionRate on left (can1)"),
        ("injector_id = 2", "injector_id = 1", "outputs.injector_id = 1"),
        ("[sampling]", '[state]\nfile = "learned.json"\n[sampling]', "learned.json"),
    ],
)
def test_results_that_two_would_send_alike_are_errors(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = two_injectors(tmp_path)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    (first, *_) = [text for text in errors(checkup(load_bench(path))) if "give each its own" in text]
    assert first.startswith("injectors: left and right share")
    assert said in first


def test_one_state_is_not_that_of_two(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="this is for one"):
        checkup(load_bench(two_injectors(tmp_path)), tmp_path / "learned.json")


def test_the_state_the_bench_file_names_is_looked_at(tmp_path: Path) -> None:
    findings = checkup(load_bench(two_injectors(tmp_path, '[injectors.left.state]\nfile = "left.json"\n')))
    (state,) = (finding.text for finding in findings if finding.topic == "learned state")
    assert state == f"left: none at {tmp_path / 'left.json'} yet, `run` begins with the prior"


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
