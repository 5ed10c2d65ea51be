"""What `check` says: each finding against a bench made to cause it."""

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, Bench, load_bench
from observer_rt.desk.check.bench_rules import checkup
from observer_rt.desk.check.buses import expected_load
from observer_rt.desk.check.findings import Finding, Level, as_json_document, as_table
from tests.daemon.foreign_frames import DATABASES
from tests.desk.cli.injector_files import in_force

DATABASE = EXAMPLE_BENCH.with_name("observer_fd.dbc")
Edits = dict[str, str]
NO_EDITS: Edits = {}
FindingsOf = Callable[..., list[Finding]]


@pytest.fixture
def findings_of(tmp_path: Path) -> FindingsOf:
    def run(bench: Edits = NO_EDITS, database: Edits = NO_EDITS, injector: Edits = NO_EDITS) -> list[Finding]:
        edited(DATABASE, tmp_path / "edited.dbc", database)
        edited(NOMINAL_INJECTOR, tmp_path / "injector.toml", injector)
        files = {
            'file = "observer_fd.dbc"': 'file = "edited.dbc"',
            '# file = "injector.toml"': 'file = "injector.toml"',
        }
        edited(EXAMPLE_BENCH, tmp_path / "bench.toml", files | bench)
        return checkup(load_bench(tmp_path / "bench.toml"))

    return run


def edited(source: Path, target: Path, edits: Edits) -> None:
    text = source.read_text(encoding="utf-8")
    for old, new in edits.items():
        assert old in text
        text = text.replace(old, new)
    target.write_text(text, encoding="utf-8")


def of(findings: list[Finding], topic: str) -> list[Finding]:
    return [finding for finding in findings if finding.topic == topic]


def worst(findings: list[Finding], topic: str) -> Finding:
    order = [Level.OK, Level.WARNING, Level.ERROR]
    return max(of(findings, topic), key=lambda finding: order.index(finding.level))


BUS_AND_OBSERVER = ("files", "mapping", "sampling", "identifiers", "frames", "integration")


def test_the_example_bench_has_no_error() -> None:
    findings = checkup(load_bench())
    assert not [finding for finding in findings if finding.level is Level.ERROR]
    for topic in (*BUS_AND_OBSERVER, "line mode", "dead band", "look-ahead", "events"):
        assert worst(findings, topic).level is Level.OK


RAIL = "SG_ RailPressure_00 : 64|16@1+ "
RANGE = RAIL + "(0.005,-10) [-10|317.665]"
STATED = "".join(re.findall(r"(?m)^\w+_percent = .*\n", NOMINAL_INJECTOR.read_text()))


@pytest.mark.parametrize(
    ("topic", "level", "file", "old", "new", "said"),
    [
        ("mapping", "warning", "database", RANGE, RAIL + "(0.005,-10) [-10|150]", "hold 0 to 200 MPa"),
        ("mapping", "warning", "database", RANGE, RAIL + "(0.005,20) [20|347]", "cannot hold 0 to"),
        ("mapping", "warning", "database", RANGE, RAIL + "(0.5,-10) [-10|400]", "coarser than the noise"),
        ("mapping", "warning", "database", "(0.01,-50) [-50|605.33]", "(0.004,-50) [-50|212]", "0 to 300 um"),
        ("mapping", "warning", "injector", "max_lift = 0.30e-3", "max_lift = 0.70e-3", "0 to 700 um"),
        ("dead band", "warning", "bench", "needle_lift_um = 0.4", "needle_lift_um = 10", "50 um"),
        ("injector", "warning", "injector", "length = 0.15 ", "length = 150 ", "line.length = 150"),
        ("level", "warning", "injector", "diameter_percent = 1.0", "diameter_percent = 2.0", "makes it ±0.4 %"),
        ("mass", "warning", "injector", "hole_diameter = 0.17e-3", "hole_diameter = 0.025e-3", "±3.1%"),
        ("level", "ok", "injector", STATED, "mass_percent = 0.2\n", "±0.4 %, calibrated"),
    ],
)
def test_what_is_odd_is_said(
    findings_of: FindingsOf, topic: str, level: str, file: str, old: str, new: str, said: str
) -> None:
    finding = worst(findings_of(**{file: {old: new}}), topic)
    assert finding.level == level
    assert said in finding.text


def test_a_sample_period_that_contradicts_the_rate(findings_of: FindingsOf) -> None:
    findings = of(findings_of({"rate_hz = 100e3": "rate_hz = 50e3"}), "sampling")
    assert [finding.level for finding in findings] == [Level.OK, Level.ERROR, Level.WARNING]
    assert "sampling.rate_hz: is 50000, but SampleBlock states a sample period of 10000 ns" in findings[1].text
    assert "SamplePeriodNs to 20000" in findings[1].text
    agreed = findings_of(
        {"rate_hz = 100e3": "rate_hz = 30e3"}, {f'Ns" BO_ {id} 10000': f'Ns" BO_ {id} 33333' for id in (256, 512)}
    )
    assert worst(agreed, "sampling").level is Level.OK


def test_the_load_of_a_bus_by_counting_frames() -> None:
    """173 us a frame at 500k/5M, 26 % windowed; three channels in and the rate out 60 % at 24 kHz."""
    bench = load_bench()
    load = expected_load(bench, map_bench(bench))
    assert load.continuous == pytest.approx(173e-6 * (1e5 / 9 + 1e5 / 28 + 10 + 17 * 0.85), rel=0.01)
    assert load.windowed == pytest.approx(0.26, abs=0.015)


@pytest.mark.parametrize(
    ("bench", "levels"),
    [
        (NO_EDITS, [Level.OK, Level.WARNING]),  # 27 %, 254 %
        ({"rate_hz = 100e3": "rate_hz = 30e3"}, [Level.OK, Level.WARNING]),  # 76 %
        ({"rate_hz = 100e3": "rate_hz = 500e3"}, [Level.ERROR, Level.ERROR]),  # 130 %, 1270 %
    ],
)
def test_levels_of_the_bus_load(findings_of: FindingsOf, bench: Edits, levels: list[Level]) -> None:
    assert [finding.level for finding in of(findings_of(bench), "bus load")] == levels


def test_the_interface_is_looked_at_for_socketcan_only(findings_of: FindingsOf) -> None:
    assert of(findings_of(), "interface")
    assert not of(findings_of({'interface = "socketcan"': 'interface = "virtual"'}), "interface")


def test_for_programs_and_for_the_screen() -> None:
    odd = "[red]\x1bx[/red]"
    findings = [Finding("a", Level.OK, "fine"), Finding("b", Level.WARNING, odd), Finding("b", Level.ERROR, "y")]
    document = json.loads(json.dumps(as_json_document(findings)))
    assert (document["schema"], document["warnings"], document["errors"]) == (1, 1, 1)
    assert document["findings"][1] == {"topic": "b", "level": "warning", "text": odd}
    console = Console(width=100)
    with console.capture() as capture:
        console.print(as_table(findings))
    assert r"[red]\x1bx[/red]" in capture.get()
    assert "error" in capture.get()


def test_the_injector_file_is_known_by_its_bytes_and_by_its_values(findings_of: FindingsOf, tmp_path: Path) -> None:
    """`sha256sum` says the first; a comment changes it, and not the hash of the values that is on the bus."""

    def hashes(injector: Edits) -> tuple[str, str]:
        texts = [finding.text for finding in of(findings_of(injector=injector), "files")]
        of_file = next(text for text in texts if "injector.toml, SHA-256 " in text)
        of_values = next(text for text in texts if "ModelHash" in text)
        digest = hashlib.sha256((tmp_path / "injector.toml").read_bytes()).hexdigest()
        assert of_file.endswith(digest)
        return of_file, of_values

    file, values = hashes(NO_EDITS)
    commented_file, commented_values = hashes({"[line]": "[line]  # of our bench"})
    assert commented_file != file
    assert commented_values == values
    assert hashes({"length = 0.15 ": "length = 0.16 "})[1] != values


def foreign_bench(folder: Path, database: Edits = NO_EDITS) -> Bench:
    edited(DATABASES / "testbed_classic.dbc", folder / "testbed_classic.dbc", database)
    edited(DATABASES / "testbed_classic.toml", folder / "bench.toml", NO_EDITS)
    return load_bench(folder / "bench.toml")


SAMPLES_STATED = {
    'BA_DEF_ BO_  "GenMsgSendType"': 'BA_DEF_ BO_  "SamplesPerFrame" INT 0 64;\nBA_DEF_ BO_  "GenMsgSendType"',
    'BA_DEF_DEF_  "GenMsgCycleTime" 0;': 'BA_DEF_DEF_  "GenMsgCycleTime" 0;\nBA_DEF_DEF_  "SamplesPerFrame" 0;',
    'BA_ "GenMsgSendType" BO_ 928 0;': 'BA_ "SamplesPerFrame" BO_ 928 2;',
}


def cycle(milliseconds: int) -> Edits:
    """The rail pressure's message every so often; its 10 kHz are a frame every 0.1 ms."""
    return {'BA_ "GenMsgSendType" BO_ 928 0;': f'BA_ "GenMsgCycleTime" BO_ 928 {milliseconds};'}


@pytest.mark.parametrize(
    ("database", "topic", "said"),
    [
        ({"BO_ 1040 ECU": "BO_ 513 ECU"}, "identifiers", "InjectionSummary shares 0x201 with ECU_Engine"),
        ({"BO_ 1040 ECU": f"BO_ {1 << 31 | 513} ECU"}, "identifiers", None),  # an extended one is another
        ({" ECU_Engine:": " InjectionSummary:"}, "databases", "InjectionSummary is in "),
        (cycle(0), "sampling", None),
        (cycle(1), "sampling", "means 1000 Hz"),
        (cycle(5), "sampling", "means 200 Hz"),
        (SAMPLES_STATED, "sampling", "DAQ_RailPress states 2 samples a frame in the bus database, 1 are named"),
    ],
)
def test_what_a_users_database_says_otherwise(tmp_path: Path, database: Edits, topic: str, said: str | None) -> None:
    finding = worst(checkup(foreign_bench(tmp_path, database)), topic)
    assert finding.level is (Level.WARNING if said else Level.OK)
    assert (said or "") in finding.text


def test_a_classic_bus_without_rates_carries_pages(tmp_path: Path) -> None:
    """Three frames a sample in; 7 frames a summary and 12 a status out, about 116 us each at 1 Mbit/s."""
    bench = foreign_bench(tmp_path)
    load = expected_load(bench, map_bench(bench))
    assert load.continuous == pytest.approx(114e-6 * (3 * 10e3 + 17 * 7 + 10 * 12), rel=0.03)
    assert load.windowed == pytest.approx(114e-6 * (3 * 60 * 17 + 17 * 7 + 10 * 12), rel=0.03)


def test_what_is_in_force_beside_the_nominal_model_is_said(findings_of: FindingsOf) -> None:
    added = """
[[terms]]
equation = "line_flow"
law = "c*max(line_flow - 25, 0)"
coefficient = { value = 0.139, unit = "MPa*ms/mm3" }
"""
    effect = in_force("orifice_area", "v_H", 0.3)
    findings = findings_of(injector={"[needle]": f"{effect}{added}\n[needle]"})
    assert [finding.text for finding in of(findings, "effects")] == [
        "orifice_area v_H = 0.3",
        "line_flow: c*max(line_flow - 25, 0), c = 0.139 MPa*ms/mm3",
    ]
    assert of(findings_of(), "effects") == []
