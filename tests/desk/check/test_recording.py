"""What `check` says of a log or a recording."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import Frame as BusFrame
from observer_rt.config.bench import load_bench
from observer_rt.desk.check.findings import Finding, Level
from observer_rt.desk.check.given_files import log_findings, recording_findings
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.formats import write_recording
from observer_rt.files.replay.framing import all_samples
from tests.daemon.time_frames import END, StampedFrame, jitter, merged, send, write_time_bench
from tests.daemon.time_scenarios import GRID, ONE_BASE, OTHER, RATE, TWO_BASES
from tests.desk.evaluation.test_logged import BENCH, frames, log_of, worn
from tests.files.canlog.log_cases import write_log


def findings_of(folder: Path, sent: list[LogFrame]) -> list[Finding]:
    return log_findings(BENCH, write_log(folder / "bus.log", sent))


def found_of(folder: Path, signals: dict[str, str], sent: list[StampedFrame]) -> list[Finding]:
    """Of devices with clocks of their own, whose frames are late by chance."""
    bench = load_bench(write_time_bench(folder, RATE, signals))
    write_log(folder / "bus.log", [LogFrame(BusFrame(f.frame_id, f.payload, f.stamp_ns), "1") for f in sent])
    return log_findings(bench, folder / "bus.log")


def number(pattern: str, finding: Finding) -> float:
    match = re.search(pattern, finding.text)
    assert match, finding.text
    return float(match[1])


def test_a_good_log(tmp_path: Path) -> None:
    findings = findings_of(tmp_path, frames())
    assert {finding.level for finding in findings} == {Level.OK}
    samples, regularity, noise = findings
    assert f"{len(frames())} input frames" in samples.text
    assert " 0 lost" in samples.text
    assert regularity.text.startswith("SampleBlock: ")
    assert abs(number(r"line pressure ([\d.]+) \(0.15\) MPa", noise) - 0.15) < 0.01
    assert abs(number(r"needle lift ([\d.]+) \(0.4\) um", noise) - 0.4) < 0.03


def test_a_recording_with_every_signal(tmp_path: Path) -> None:
    level = (worn().needle_lift > 1e-5).astype(float)
    lift = worn().needle_lift + 0.8e-6 * np.random.default_rng(1).standard_normal(level.size)  # beside .4 um
    recording = replace(worn(), needle_lift=lift, injection_rate=1e-4 * level, energizing=level)
    write_recording(tmp_path / "a.csv", recording)
    findings = [*recording_findings(BENCH, tmp_path / "a.csv")]
    texts = [finding.text for finding in findings]
    assert f"energizing: 0 to 1, mean {level.mean():.4g}" in texts
    assert f"injection_rate: 0 to 100 mm3/ms, mean {100.0 * level.mean():.4g} mm3/ms" in texts
    (band,) = (finding for finding in findings if "dead band" in finding.text)
    assert number(r"open above ([\d.]+) um", band) == pytest.approx(5.0 * np.hypot(0.4, 0.8), rel=0.05)
    assert number(r"noise of the lift ([\d.]+) um", band) == pytest.approx(np.hypot(0.4, 0.8), rel=0.05)


def test_hum_is_told(tmp_path: Path) -> None:
    hum = 0.2e6 * np.sin(2.0 * np.pi * 50.0 * worn().time)
    humming = replace(worn(), line_pressure=worn().line_pressure + hum)
    findings = findings_of(tmp_path, log_of(humming, all_samples(humming)))
    assert {finding.level for finding in findings} == {Level.OK}
    noise_finding = findings[-1]
    assert noise_finding.text.startswith("noise of the line pressure is not white: hum ")
    assert abs(number(r"hum (\d+) Hz", noise_finding) - 50.0) <= 2.0
    assert abs(number(r"Hz ([\d.]+) MPa", noise_finding) - 0.2) < 0.03


def test_jitter_is_told_in_microseconds_and_words(tmp_path: Path) -> None:
    sent = {name: send(name, GRID, jitter(300e-6), END) for name in ("Line", "RailLift")}
    findings = found_of(tmp_path, ONE_BASE, merged(*sent.values()))
    for name, sent_frames in sent.items():
        (text,) = (f for f in findings if f.text.startswith(f"{name}: "))
        sigma = number(r"jitter ([\d.]+) us", text)
        delays = [frame.stamp_ns - 1e9 * frame.taken for frame in sent_frames]
        assert text.level is Level.OK
        assert abs(1e3 * sigma / np.std(np.array(delays) - delays[0]) - 1.0) < 0.1
        greatest = number(r"late by up to ([\d.]+) ms", text)
        assert abs(1e6 * greatest / (max(delays) - min(delays)) - 1.0) < 0.1
        assert text.text.endswith("samples are counted")
        assert "MPa" not in text.text


def test_losses_are_warnings(tmp_path: Path) -> None:
    damaged = frames()[200]
    payload = bytes([damaged.frame.payload[0] ^ 1]) + damaged.frame.payload[1:]
    sent = [*frames()[:100], *frames()[103:200], damaged._replace(frame=damaged.frame._replace(payload=payload))]
    findings = findings_of(tmp_path, [*sent, *frames()[201:]])
    warnings = [finding.text for finding in findings if finding.level is Level.WARNING]
    assert " 36 lost" in warnings[0]
    assert "1 with CRC errors" in warnings[1]


def test_clocks_that_stamps_do_not_tell_are_a_warning(tmp_path: Path) -> None:
    delays = jitter(200e-6)
    sent = merged(send("Line", GRID, delays, END), send("RailLift", OTHER, delays, END))
    warnings = [f for f in found_of(tmp_path, TWO_BASES, sent) if f.level is Level.WARNING]
    assert [finding.text.split(":")[0] for finding in warnings] == ["RailLift"]
    assert "docs/time.md" in warnings[0].text


def test_a_log_that_cannot_be_read_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "bus.log").write_text("no frame at all\n")
    (finding,) = log_findings(BENCH, tmp_path / "bus.log")
    assert finding.level is Level.ERROR
    assert "bus.log, line 1: " in finding.text
