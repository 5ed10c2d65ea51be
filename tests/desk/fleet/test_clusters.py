"""A batch on a scheduler that is there already, which serves others too; an effect in force."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.desk.fleet.dataset import read_injections
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.formats import write_recording
from observer_rt.model.effects import sized
from tests.desk.fleet.rows import masses
from tests.desk.fleet.running import ended, started

pytestmark = pytest.mark.slow
CLUSTER = """
import sys, time
from distributed import LocalCluster
if __name__ == "__main__":
    where = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with LocalCluster(n_workers=2, threads_per_worker=1, **where) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""
IN_FORCE = '\n[[effects]]\nid = "orifice_area"\nparameters = { v_H = { value = 0.3, unit = "-" } }\n'


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a scheduler in another process, whose workers have another working directory."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "cluster.py").write_text(CLUSTER)
    process = subprocess.Popen(
        [sys.executable, "cluster.py"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=elsewhere,
    )
    assert process.stdout is not None
    yield process.stdout.readline().strip()
    process.communicate()


@dataclass(frozen=True)
class Desk:
    """A folder with a recording of a worn nozzle, and a model that has the wear in force."""

    folder: Path

    def masses(self, out: str) -> list[float]:
        return [row["mass_mg"] for row in read_injections(self.folder / out).to_pylist()]


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Desk:
    folder = tmp_path_factory.mktemp("desk")
    (folder / "amended.toml").write_text(NOMINAL_INJECTOR.read_text() + IN_FORCE)
    schedule = make_schedule([60e6, 140e6], 2, 0.05, [0.6e-3])
    hidden = (sized("orifice_area", v_H=0.3),)
    made = simulate(load_injector(), schedule, 100e3, hidden, SimulatedNoise(), seed=3)
    write_recording(folder / "injector_a.csv", made.recording)
    return Desk(folder)


def test_effects_are_in_force_on_a_scheduler_that_is_there(scheduler: str, desk: Desk) -> None:
    """Its workers find files by the paths of the command."""
    common = ("injector_a.csv", "--scheduler", scheduler)
    plain = ended(started(*common, "--out", "plain", cwd=desk.folder))
    assert (plain["done"], plain["failed"]) == (1, 0)
    own = ended(started(*common, "--out", "own", "--model", "amended.toml", cwd=desk.folder))
    assert (own["done"], own["failed"]) == (1, 0)
    nominal = masses(desk.folder / "injector_a.csv")
    with_wear = masses(desk.folder / "injector_a.csv", desk.folder / "amended.toml")
    assert desk.masses("plain") == pytest.approx(nominal, rel=1e-12)
    assert desk.masses("own") == pytest.approx(with_wear, rel=1e-12)
    assert nominal != pytest.approx(with_wear, rel=1e-6)
