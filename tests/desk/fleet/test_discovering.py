"""Discovery over many recordings on a real cluster: an answer an injector, whatever is killed, damaged or odd."""

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, load_injector
from observer_rt.desk.cli.models import DiscoverOptions, discover
from observer_rt.desk.fleet.answers import TABLE
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.formats import write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.model.effects import sized
from tests.desk.fleet.running import ended, started, wait_until, workers_of

pytestmark = pytest.mark.slow
POINTS = ((60e6, 1.9e-3), (140e6, 0.6e-3))
HIDDEN = {"bent": (sized("line_friction", k=0.6),), "new": (), "worn": (sized("orifice_area", v_H=0.1),)}
"""What is in an injector, which only the truths beside its recordings say."""


def made(injector: str, pressure: float, duration: float, sample_rate: float = 100e3) -> Recording:
    schedule = make_schedule([pressure], 2, 0.06, [duration])
    seed = ord(injector[0]) + round(pressure / 1e6)
    return simulate(
        load_injector(), schedule, sample_rate, HIDDEN.get(injector, ()), SimulatedNoise(), seed=seed
    ).recording


def write(path: Path, recording: Recording) -> None:
    path.parent.mkdir(exist_ok=True)
    write_recording(path, recording)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of each injector; an older one at another rate, a damaged one, one of gaps."""
    folder = tmp_path_factory.mktemp("measured")
    for injector in HIDDEN:
        for number, point in enumerate(POINTS):
            write(folder / f"injector_{injector}" / f"run_{number}.csv", made(injector, *point))
    slow = folder / "injector_worn" / "long_ago.csv"
    write(slow, made("worn", *POINTS[0], sample_rate=50e3))
    os.utime(slow, (1e9, 1e9))
    (folder / "injector_worn" / "damaged.csv").write_text("time_s,rail_pressure_MPa\n1,2\n")
    write(folder / "injector_odd" / "gaps.csv", with_gaps(made("odd", *POINTS[0])))
    return folder


def with_gaps(recording: Recording) -> Recording:
    """A sample is missing wherever the needle has come down."""
    lift = recording.needle_lift > 20e-6
    line = recording.line_pressure.copy()
    line[1:][lift[:-1] & ~lift[1:]] = np.nan
    return replace(recording, line_pressure=line)


@dataclass(frozen=True)
class Run:
    """A batch, one of whose workers was killed in the search, and the same command again."""

    folder: Path
    said: dict[str, Any]
    again: dict[str, Any]
    written: dict[Path, int]
    written_again: dict[Path, int]

    @property
    def rows(self) -> dict[str, dict[str, Any]]:
        return {row["injector"]: row for row in pq.read_table(self.folder / TABLE).to_pylist()}


@pytest.fixture(scope="module")
def run(measured: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("results")
    arguments = (measured, "--out", folder, "--discover")
    process = started(*arguments)
    wait_until(process, lambda: any(fits(path) > 2 for path in folder.glob("discovered/*/fits.jsonl")))
    for worker in workers_of(process)[:1]:
        worker.kill()
    said, written = ended(process), times(folder)
    again = ended(started(*arguments))
    return Run(folder, said, again, written, times(folder))


def fits(path: Path) -> int:
    return len(path.read_text().splitlines())


def times(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.glob("discovered/*/*")}


def test_every_injector_has_its_answer_though_a_worker_was_killed(run: Run) -> None:
    assert {name: run.rows[name]["verdict"] for name in HIDDEN} == {
        "bent": "named",
        "new": "none",
        "worn": "named",
    }
    for name, effect_id, parameter, size in (
        ("bent", "line_friction", "k", 0.6),
        ("worn", "orifice_area", "v_H", 0.1),
    ):
        row = run.rows[name]
        assert (row["effects"], row["parameter"], row["unit"]) == (effect_id, parameter, "-")
        assert row["size"] == pytest.approx(size, abs=0.1 * size)
        assert row["size_low"] < row["size"] < row["size_high"]
        assert row["line_pressure_before_MPa"] > 2.0 * row["line_pressure_after_MPa"]
        assert row["line_pressure_after_MPa"] < 2.0 * row["line_pressure_noise_floor_MPa"]
        (effect,) = load_injector(run.folder / row["amended"]).effects
        assert effect.parameters[parameter].value == row["size"]
    assert run.rows["new"]["amended"] is None
    assert run.said["discovered"]["done"] == len(HIDDEN)


def test_the_most_affected_come_first_and_those_without_an_answer_last(run: Run) -> None:
    off = [run.rows[name]["line_pressure_before_MPa"] for name in list(run.rows)[:3]]
    assert off == sorted(off, reverse=True)
    assert list(run.rows)[2:] == ["new", "odd"]
    assert run.said["discovered"]["injectors"] == list(run.rows.values())


def test_what_could_not_be_taken_is_said_of_its_injector(run: Run) -> None:
    errors = pq.read_table(run.folder / "errors.parquet").to_pylist()
    said = {(each["injector"], each["file"] and Path(each["file"]).name): each["problem"] for each in errors}
    assert set(said) == {(None, "damaged.csv"), ("worn", "long_ago.csv"), ("odd", "gaps.csv"), ("odd", None)}
    assert "is sampled at 50000 Hz" in said["worn", "long_ago.csv"]
    assert "no complete injection; samples are missing" in said["odd", "gaps.csv"]
    assert (run.rows["worn"]["recordings"], run.rows["worn"]["judged"], run.rows["worn"]["left_out"]) == (
        3,
        2,
        1,
    )
    assert run.rows["odd"]["verdict"] is None
    assert said["odd", "gaps.csv"] in run.rows["odd"]["problem"]
    assert run.rows["odd"]["problem"] in said["odd", None]
    assert (run.said["done"], run.said["failed"], run.said["discovered"]["failed"]) == (8, 1, 1)


def test_what_is_the_same_is_not_done_again(run: Run) -> None:
    counts = {name: run.again["discovered"][name] for name in ("done", "skipped", "failed")}
    assert (run.again["done"], run.again["skipped"]) == (0, 8)
    assert counts == {"done": 0, "skipped": len(HIDDEN), "failed": 1}
    assert run.again["discovered"]["injectors"] == run.said["discovered"]["injectors"]
    changed = {path.parent.name for path, time in run.written_again.items() if time != run.written[path]}
    assert changed <= {"odd"}


def test_the_findings_are_those_of_discover(
    run: Run, measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the same recordings, although a worker was killed, others were left out and none had more than a thread."""
    files = sorted(measured.glob("injector_worn/run_?.csv"), key=lambda path: path.stat().st_mtime)
    discover(DiscoverOptions(out=tmp_path, recordings=tuple(files[::-1]), bench=EXAMPLE_BENCH, json=True))
    alone = json.loads(capsys.readouterr().out)
    fleet = json.loads((run.folder / run.rows["worn"]["report"]).with_name("findings.json").read_text())
    for varying in ("made", "seconds"):
        assert alone.pop(varying)
        assert fleet.pop(varying)
    assert fleet == alone


def test_healthy_recordings_tell_what_is_the_model_s_own(measured: Path, tmp_path: Path) -> None:
    """Those of an injector with another fault: the model is off already, and the wear is not believed any more."""
    healthy = [word for path in sorted(measured.glob("injector_bent/*.csv")) for word in ("--healthy", path)]
    said = ended(started(measured / "injector_worn", "--out", tmp_path, "--discover", *healthy))
    (worn,) = said["discovered"]["injectors"]
    assert "the model's own error" in worn["caveats"]
    findings = json.loads((tmp_path / worn["report"]).with_name("findings.json").read_text())
    assert findings["healthy"] == ["run_0.csv", "run_1.csv"]
    assert "named: line_friction" in findings["healthy_warning"]
