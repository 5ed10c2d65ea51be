"""Snapshots of a daemon, asked for at its socket: what it has, in the client's time."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.daemon.control_socket import control_socket, daemon_connection, socket_places
from observer_rt.daemon.snapshot import SNAPSHOT, WITH_CURVES, Snapshot, StatusLevel, line_of, read_snapshot
from observer_rt.daemon.snapshot_keeper import SnapshotKeeper
from observer_rt.daemon.view import View
from observer_rt.engine.reports.news import MeasuredMass, Notice
from observer_rt.engine.words import Topic
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLIMETRE
from tests.daemon.participants import HeardDaemon, ScriptedLink, TroubledLink, bench_file, drawn, serving, until
from tests.device import frames_of, worn_recording

WEAR = 0.2


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return bench_file(tmp_path, "snapshots")


def asked(path: Path, run: int = 0, since: int = 0, wait: float = 0.0) -> Snapshot:
    """The answer to a client at the socket that the bench file leads to."""
    file, *_ = socket_places(load_bench(path).injector)
    daemon = daemon_connection(file)
    assert daemon is not None
    with daemon, daemon.makefile("rwb") as stream:
        stream.write(line_of({"request": SNAPSHOT, "run": run, "since": since, "wait": wait, "laws": True}))
        stream.flush()
        return read_snapshot(stream)


@contextmanager
def observing(path: Path, link: ScriptedLink, injections: int = 4) -> Iterator[HeardDaemon]:
    """A daemon that has taken all frames and judged so many injections, and may be asked."""
    daemon = HeardDaemon(path, link)
    file, *_ = socket_places(load_bench(path).injector)
    with control_socket(file, {SNAPSHOT: daemon.snapshots.answer}), serving(daemon):
        until(link.empty.is_set)
        until(lambda: daemon.core.counters.frames >= link.frames)
        until(lambda: len(daemon.notes.injections) >= injections)  # the last is reported after its frames
        yield daemon


def test_injections_have_what_the_daemon_computed(path: Path) -> None:
    recording = worn_recording(6, WEAR)
    with observing(path, ScriptedLink(frames_of(path, recording)), injections=6) as daemon:
        snapshot = asked(path)
        shown, reports = snapshot.injections, daemon.notes.injections
    assert [injection.values["number"] for injection in shown] == [injection.number for injection in reports]
    for injection, report in zip(shown, reports, strict=True):
        window, curves = slice(report.start_index, report.end_index + 1), injection.curves
        rate, time_ms = curves["rate_mm3_per_ms"], curves["time_ms"]
        assert curves["rail_pressure_MPa"] == pytest.approx(recording.rail_pressure[window] / MEGAPASCAL, abs=0.004)
        assert curves["line_pressure_MPa"] == pytest.approx(recording.line_pressure[window] / MEGAPASCAL, abs=0.004)
        lift = recording.needle_lift[window] / MILLIMETRE
        assert curves["needle_lift_um"] * 1e-3 == pytest.approx(lift, abs=1e-5)
        live = 1e-3 * np.trapezoid(rate, time_ms) * report.density
        assert live == pytest.approx(report.live_mass / MILLIGRAM, rel=1e-3)
        corrected = 1e-3 * np.trapezoid(curves["corrected_rate_mm3_per_ms"], time_ms) * report.density
        assert injection.values["mass_mg"] == pytest.approx(report.mass / MILLIGRAM)
        assert injection.values["mass_mg"] == pytest.approx(corrected, rel=1e-3)
        gap = curves["modelled_pressure_MPa"] - curves["line_pressure_MPa"]
        assert float(np.abs(gap).max()) < 8.0
        assert injection.values["valid"] == report.valid
    last = shown[-1]
    nominal = float(np.trapezoid(last.curves["nominal_rate_mm3_per_ms"], last.curves["time_ms"]))
    assert 1e-3 * nominal * reports[-1].density == pytest.approx(last.references["nominal"], rel=1e-3)
    assert last.values["mass_mg"] / last.references["nominal"] == pytest.approx(1.0 + WEAR, abs=0.05)
    assert 0.0 < float(last.curves["corrected_rate_sigma_mm3_per_ms"].max()) < 5.0
    assert [each.values["remainder"] for each in (shown[0], last)] == ["flow 16 % above the model", ""]
    assert {curve["flow"] for curve in snapshot.status.learned} == {"orifice_area", "seat_area"}
    assert snapshot.status.learned[0]["change"][-1] == pytest.approx(WEAR, abs=0.05)


def test_the_nominal_model_is_what_an_injector_that_learned_nothing_shows(path: Path) -> None:
    """Without wear and learning both are the same; the nominal one runs on its own, from the inputs."""
    path.write_text(path.read_text().replace("enabled = true", "enabled = false"))
    with observing(path, ScriptedLink(frames_of(path, worn_recording(v_h=0.0)))):
        shown = asked(path).injections
    assert len(shown) == 4
    for injection in shown:
        assert injection.references["nominal"] == pytest.approx(injection.values["mass_mg"], rel=2e-3)


def test_only_news_are_sent_and_waited_for(path: Path) -> None:
    with observing(path, ScriptedLink(frames_of(path, worn_recording()))) as daemon:
        first = asked(path)
        run, last = first.status.run, first.injections[-1].count
        assert [each.count for each in asked(path, run, last - 1).injections] == [last]
        begin = time.monotonic()
        assert asked(path, run, last, wait=0.2).injections == ()
        assert time.monotonic() - begin > 0.15
        assert len(asked(path, run + 1, last, wait=0.2).injections) == last  # of another daemon
        daemon.snapshots.hear(MeasuredMass(daemon.notes.injections[-1], 12.3 * MILLIGRAM))
        assert asked(path).injections[-1].values["measured_mass_mg"] == pytest.approx(12.3)


def test_curves_are_kept_of_the_last_injections_only(path: Path) -> None:
    link = ScriptedLink(frames_of(path, worn_recording(injections=WITH_CURVES + 4)))
    with observing(path, link, WITH_CURVES + 4) as daemon:
        shown = asked(path).injections
        for _ in range(1000):
            daemon.snapshots.hear(daemon.notes.injections[-1])
        assert len(asked(path).injections) == 1000  # as docs/monitor.md says
    assert [bool(each.curves) for each in shown] == 4 * [False] + WITH_CURVES * [True]


def test_a_silent_input_is_a_fault_of_its_message_with_its_remedy(path: Path) -> None:
    with observing(path, ScriptedLink(frames_of(path, worn_recording()))):
        assert asked(path).status.level is StatusLevel.GOOD
        until(lambda: "SampleBlock 0x100 (rail" in str(asked(path).status.faults))
        status = asked(path).status
    (fault,) = status.faults
    assert 1.0 < (time.time_ns() - fault.since) * 1e-9 < 60.0
    assert "cable" in fault.remedy
    assert (status.state, status.level) == ("WAITING_FOR_DATA", StatusLevel.WAITING)


def test_what_is_not_calibrated_is_not_green(path: Path) -> None:
    path.write_text(path.read_text().replace("accuracy_percent = 0.0", "accuracy_percent = 0.7"))
    with observing(path, ScriptedLink(frames_of(path, worn_recording()))) as daemon:
        snapshot = asked(path)
        text = daemon.drawn()
    assert (snapshot.status.state, snapshot.status.level) == ("ADAPTED", StatusLevel.WAITING)
    level = daemon.notes.injections[-1].calibration.as_text()
    assert level in snapshot.status.words
    assert f"{level}; rates at 830 kg/m3" in text
    verdicts = {each.values["verdict"] for each in snapshot.injections if each.values["valid"]}
    assert verdicts == {"valid, not calibrated"}
    assert snapshot.injections[-1].values["density_kg_per_m3"] == 830.0


def test_a_bus_that_is_down_says_why(path: Path) -> None:
    link = TroubledLink(frames_of(path, worn_recording()))
    with observing(path, link):
        link.plugged.clear()
        until(lambda: bool(asked(path).status.buses[0].down))
        until(lambda: bool(asked(path).status.faults))
        fault = asked(path).status.faults[0]
        assert "can5 is down" in fault.what
        assert fault.remedy == "plug it in"
        link.plugged.set()
        until(lambda: not asked(path).status.buses[0].down)


def test_before_the_interface_is_there(path: Path) -> None:
    snapshots = SnapshotKeeper(load_bench(path))
    snapshots.hear(Notice(Topic.LINK, "waiting for the interface: can5 is away\n  remedy: plug it in"))
    status = snapshots.take().status
    assert (status.state, status.level) == ("STARTING", StatusLevel.WAITING)
    (fault,) = status.faults
    assert (fault.what, fault.remedy) == ("waiting for the interface: can5 is away", "plug it in")
    assert "can5 is away" in "\n".join(drawn(View("title", snapshots.take)))


def test_a_request_that_is_none_is_refused(path: Path) -> None:
    with observing(path, ScriptedLink(), injections=0), pytest.raises(UserError, match="no request"):
        asked(path, since="?")  # type: ignore[arg-type]


def test_a_daemon_that_answers_keeps_its_socket(path: Path) -> None:
    file, *_ = socket_places(load_bench(path).injector)
    with control_socket(file, {}), pytest.raises(OSError, match="another daemon"), control_socket(file, {}):
        pass
