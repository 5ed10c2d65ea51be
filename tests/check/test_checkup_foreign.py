"""What `check` says of a bus that is not ours: all its messages, cycle times, frames that carry pages."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.check.buses import expected_load
from observer_rt.check.checkup import Finding, Level, checkup
from observer_rt.config.bench import load_bench
from tests.check.test_checkup import NO_EDITS, Edits, edited, worst
from tests.service.foreign_frames import DATABASES


def foreign_findings(folder: Path, database: Edits) -> list[Finding]:
    """Findings of a bench with one sample a frame whose database is edited."""
    edited(DATABASES / "testbed_classic.dbc", folder / "testbed_classic.dbc", database)
    edited(DATABASES / "testbed_classic.toml", folder / "bench.toml", NO_EDITS)
    return checkup(load_bench(folder / "bench.toml"))


def test_an_identifier_that_another_message_of_the_bus_has(tmp_path: Path) -> None:
    finding = worst(foreign_findings(tmp_path, {"BO_ 1040 ECU_Engine": "BO_ 513 ECU_Engine"}), "identifiers")
    assert finding.level is Level.WARNING
    assert "InjectionSummary shares 0x201 with ECU_Engine" in finding.text


def test_the_same_number_as_an_extended_identifier_is_another(tmp_path: Path) -> None:
    extended = {"BO_ 1040 ECU_Engine": f"BO_ {1 << 31 | 513} ECU_Engine"}
    assert worst(foreign_findings(tmp_path, extended), "identifiers").level is Level.OK


def test_a_message_that_two_databases_define(tmp_path: Path) -> None:
    finding = worst(foreign_findings(tmp_path, {" ECU_Engine:": " InjectionSummary:"}), "databases")
    assert finding.level is Level.WARNING
    assert "InjectionSummary is in " in finding.text
    assert "observer_classic.dbc" in finding.text


@pytest.mark.parametrize(("cycle", "level"), [(0, Level.OK), (1, Level.WARNING), (5, Level.WARNING)])
def test_a_cycle_time_that_contradicts_the_rate(tmp_path: Path, cycle: int, level: Level) -> None:
    """10 kHz is a frame every 0.1 ms."""
    stated = {'BA_ "GenMsgSendType" BO_ 928 0;': f'BA_ "GenMsgCycleTime" BO_ 928 {cycle};'}
    finding = worst(foreign_findings(tmp_path, stated), "sampling")
    assert finding.level is level
    assert level is Level.OK or f"means {1000 / cycle:g} Hz" in finding.text


def test_samples_that_the_mapping_leaves_out(tmp_path: Path) -> None:
    """The database says two samples in a frame, one is named."""
    stated = {
        'BA_DEF_ BO_  "GenMsgSendType"': 'BA_DEF_ BO_  "SamplesPerFrame" INT 0 64;\nBA_DEF_ BO_  "GenMsgSendType"',
        'BA_DEF_DEF_  "GenMsgCycleTime" 0;': 'BA_DEF_DEF_  "GenMsgCycleTime" 0;\nBA_DEF_DEF_  "SamplesPerFrame" 0;',
        'BA_ "GenMsgSendType" BO_ 928 0;': 'BA_ "SamplesPerFrame" BO_ 928 2;',
    }
    finding = worst(foreign_findings(tmp_path, stated), "sampling")
    assert "DAQ_RailPress states 2 samples a frame in the bus database, 1 are named" in finding.text


def test_a_classic_bus_without_rates_carries_pages(tmp_path: Path) -> None:
    """Three frames a sample in; 7 frames a summary and 12 a status out, about 116 us each at 1 Mbit/s."""
    edited(DATABASES / "testbed_classic.dbc", tmp_path / "testbed_classic.dbc", NO_EDITS)
    edited(DATABASES / "testbed_classic.toml", tmp_path / "bench.toml", NO_EDITS)
    bench = load_bench(tmp_path / "bench.toml")
    load = expected_load(bench, map_bench(bench))
    assert load.continuous == pytest.approx(114e-6 * (3 * 10e3 + 17 * 7 + 10 * 12), rel=0.03)
    assert load.windowed == pytest.approx(114e-6 * (3 * 60 * 17 + 17 * 7 + 10 * 12), rel=0.03)
