"""The daemon's evidence: what a core sees of an event is what its device sent, on disk by a process of its own."""

import os
import shutil
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector_sections import EvidenceConfig
from observer_rt.daemon.control_socket import OBSERVER
from observer_rt.daemon.evidence_keeper import evidence_keeper
from observer_rt.daemon.lock import is_written
from observer_rt.daemon.state_file import model_hash
from observer_rt.engine.reports.evidence import EvidenceKind
from observer_rt.files.evidence_folder import KeptEvent, read_evidence
from observer_rt.foundation.errors import UserError
from observer_rt.model.parameters import EffectInForce, EffectValue
from tests.daemon.participants import bench_file, until
from tests.device import worn_recording
from tests.kept_evidence import keeping, observe

INJECTIONS = 3


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return load_bench(bench_file(tmp_path, "unused")).with_sections(evidence=EvidenceConfig(folder="evidence"))


def kept(bench: Bench) -> list[KeptEvent]:
    folder = bench.injector.evidence
    assert folder is not None
    return [read_evidence(path) for path in sorted(folder.glob("*.parquet"))]


@pytest.mark.parametrize("gain", [0.0, 0.02])
def test_what_is_kept_is_what_was_sent(bench: Bench, gain: float) -> None:
    """Also where the model in force mends the rail pressure: else `discover` would mend it twice."""
    size = EffectInForce(id="rail_pressure_sensor_gain", parameters={"g": EffectValue(value=gain, unit="-")})
    bench = bench.with_parameters(bench.injector.parameters.model_copy(update={"effects": (size,) if gain else ()}))
    messages: list[str] = []
    recording = worn_recording(INJECTIONS)
    with keeping(bench, messages) as keeper:
        observe(keeper, bench, recording)
        until(lambda: keeper.kept == INJECTIONS - 1)
    assert (keeper.kept, keeper.lost, messages) == (INJECTIONS, 0, [])
    events = kept(bench)
    if not gain:
        assert {event.kind for event in events} <= {EvidenceKind.GOOD, EvidenceKind.DOUBTFUL}
    for event in events:
        assert event.belief["model_sha256"] == model_hash(bench.injector.parameters)
        (injection,) = event.belief["injections"]
        assert injection["mass_mg"] > 0.0
        first = round(event.recording.time[0] * recording.sample_rate)
        same = slice(first, first + event.recording.samples)
        for name, step in (("rail_pressure", 5e3), ("needle_lift", 1e-8), ("line_pressure", 5e3)):
            np.testing.assert_allclose(event.recording.arrays[name], recording.arrays[name][same], atol=step)
        opened = np.flatnonzero(event.recording.needle_lift > 20e-6)
        assert opened[0] >= round(3e-3 * recording.sample_rate)
        assert event.recording.samples - opened[-1] >= round(12e-3 * recording.sample_rate)


def test_a_killed_writer_costs_an_event_at_most_told_once(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    messages: list[str] = []
    processes: list[subprocess.Popen[bytes]] = []
    start = subprocess.Popen

    def started(*arguments: object, **options: object) -> "subprocess.Popen[bytes]":
        processes.append(start(*arguments, **options))  # type: ignore[call-overload]
        return processes[-1]

    monkeypatch.setattr("observer_rt.daemon.evidence_keeper.subprocess.Popen", started)
    recording = worn_recording(INJECTIONS)
    with keeping(bench, messages) as keeper:
        observe(keeper, bench, recording)
        until(lambda: keeper.kept >= INJECTIONS - 1)
        os.kill(processes[0].pid, signal.SIGKILL)
        processes[0].wait()
        observe(keeper, bench, recording)
        until(lambda: keeper.kept + keeper.lost >= 2 * INJECTIONS - 2)
    assert keeper.lost <= 1
    assert len(processes) == 2
    assert len(messages) == keeper.lost


def test_a_folder_that_cannot_be_written_is_told_once_and_when_it_is_over(bench: Bench, tmp_path: Path) -> None:
    messages: list[str] = []
    folder, recording = tmp_path / "evidence", worn_recording(INJECTIONS)
    with keeping(bench, messages) as keeper:
        folder.rename(tmp_path / "elsewhere")
        folder.write_text("in the way")
        observe(keeper, bench, recording)
        until(lambda: keeper.lost == INJECTIONS - 1)
        folder.unlink()
        folder.mkdir()
        observe(keeper, bench, recording)
        until(lambda: keeper.kept == INJECTIONS)
    assert len(messages) == 2
    assert "cannot be kept" in messages[0]
    assert "remedy" in messages[0]
    assert messages[1] == f"evidence is kept in {folder} again; {INJECTIONS - 1} events were lost"


def test_a_folder_that_is_removed_is_told_and_made_anew(bench: Bench, tmp_path: Path) -> None:
    messages: list[str] = []
    folder, recording = tmp_path / "evidence", worn_recording(INJECTIONS)
    with keeping(bench, messages) as keeper:
        observe(keeper, bench, recording)
        until(lambda: keeper.kept == INJECTIONS - 1)
        shutil.rmtree(folder)
        observe(keeper, bench, recording)
    assert (keeper.kept, keeper.lost) == (2 * INJECTIONS, 0)
    assert len(kept(bench)) == INJECTIONS + 1
    (line,) = messages
    assert line.startswith(f"warning: the evidence in {folder} was removed")


def test_a_folder_belongs_to_one_daemon(bench: Bench, tmp_path: Path) -> None:
    folder = tmp_path / "evidence"
    assert not is_written(folder / OBSERVER)
    with evidence_keeper(bench.injector, folder, print):
        assert is_written(folder / OBSERVER)
        with pytest.raises(UserError, match="in use by process"), evidence_keeper(bench.injector, folder, print):
            pass
    assert not is_written(folder / OBSERVER)
