"""A batch on a real cluster of processes: nothing is lost, doubled or done again, whatever is killed or damaged."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.desk.fleet.batch import read_injections
from observer_rt.files.formats import write_recording
from observer_rt.foundation.files import file_hash
from tests.daemon.end_to_end import wait_for
from tests.desk.cli.injector_files import worn_file
from tests.desk.fleet.rows import masses
from tests.desk.fleet.running import PATIENCE, ended, started, workers_of
from tests.device import simulated

pytestmark = pytest.mark.slow
INJECTIONS = 6


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of each of three injectors, one of them twice, a damaged one, and a truth."""
    folder = tmp_path_factory.mktemp("measured")
    for number in range(6):
        wear = 0.1 * (number % 3)
        made = simulated(INJECTIONS, wear, (60e6, 120e6), seed=number)
        path = folder / f"injector_{number % 3}" / f"run_{number // 3}.csv"
        path.parent.mkdir(exist_ok=True)
        write_recording(path, made)
    shutil.copy(folder / "injector_1" / "run_0.csv", folder / "injector_1" / "copy.csv")
    (folder / "injector_2" / "damaged.csv").write_text("time_s,rail_pressure_MPa\n1,2\n")
    (folder / "injector_2" / "run_0.csv.truth.csv").write_text("not for the observer")
    return folder


CLUSTER = """
import sys, time
from distributed import LocalCluster
if __name__ == "__main__":
    where = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with LocalCluster(n_workers=2, threads_per_worker=1, **where) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a scheduler in another process, whose workers have another working directory."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "cluster.py").write_text(CLUSTER)
    process = subprocess.Popen(
        [sys.executable, "cluster.py"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=elsewhere
    )
    assert process.stdout is not None
    yield process.stdout.readline().strip()
    process.communicate()


def test_a_killed_worker_loses_and_doubles_nothing(recordings: Path, scheduler: str, tmp_path: Path) -> None:
    process = started(recordings, "--out", tmp_path)
    wait_for(lambda: any(tmp_path.glob("injections/*.parquet")), PATIENCE, process)
    workers_of(process)[0].kill()
    said = ended(process)
    assert (said["done"], said["skipped"]) == (6, 1)
    (failed,) = said["failed"]
    assert Path(failed["file"]).name == "damaged.csv"
    rows = read_injections(tmp_path).to_pylist()
    keys = [(row["file"], row["number"]) for row in rows]
    assert len(set(keys)) == len(keys) == said["injections"]
    for path in sorted(recordings.glob("*/run_?.csv")):
        mine = [row for row in rows if row["sha256"] == file_hash(path)]
        assert [row["mass_mg"] for row in mine] == pytest.approx(masses(path), rel=1e-12)
        assert {row["injector"] for row in mine} == {path.parent.name[-1]}
    again = ended(started(recordings, "--out", tmp_path, "--scheduler", scheduler))
    assert (again["done"], again["skipped"], len(again["failed"])) == (0, 7, 1)
    assert read_injections(tmp_path).num_rows == len(rows)


def test_an_interrupted_batch_goes_on(recordings: Path, scheduler: str, tmp_path: Path) -> None:
    process = started(recordings, "--out", tmp_path)
    wait_for(lambda: any(tmp_path.glob("injections/*.parquet")), PATIENCE, process)
    process.terminate()
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "give the same command again" in err
    before = read_injections(tmp_path).num_rows
    assert before > 0
    said = ended(started(recordings, "--out", tmp_path, "--scheduler", scheduler))
    assert said["done"] != 0
    assert said["done"] + said["skipped"] == 7
    assert read_injections(tmp_path).num_rows == before + said["injections"]


def test_no_scheduler_is_said_with_what_to_do(recordings: Path, tmp_path: Path) -> None:
    process = started(recordings, "--out", tmp_path, "--scheduler", "tcp://127.0.0.1:1")
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "tcp://127.0.0.1:1" in err
    assert "remedy: start one" in err


def test_effects_are_in_force_on_a_scheduler_that_is_there(scheduler: str, tmp_path: Path) -> None:
    """Its workers find files by the paths of the command."""
    worn_file(tmp_path / "amended.toml")
    write_recording(tmp_path / "injector_a.csv", simulated(2, 0.3, (60e6, 140e6), 100e3, seed=3))
    arguments = ("injector_a.csv", "--scheduler", scheduler, "--out", "own", "--model", "amended.toml")
    said = ended(started(*arguments, cwd=tmp_path))
    assert (said["done"], said["failed"]) == (1, [])
    by_batch = [row["mass_mg"] for row in read_injections(tmp_path / "own").to_pylist()]
    with_wear = masses(tmp_path / "injector_a.csv", tmp_path / "amended.toml")
    assert by_batch == pytest.approx(with_wear, rel=1e-12)
    assert by_batch != pytest.approx(masses(tmp_path / "injector_a.csv"), rel=1e-6)
