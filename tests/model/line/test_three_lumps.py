"""A feed line is one file: a second one, with four states more, simulated, observed, learned with and discovered.

The commands run in processes of their own, with a cache of compiled code that only they use: nobody else's may name
a line that only tests have.
"""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from tests.model.line import three_lumps

ROOT = Path(__file__).parents[3]


def own_cache() -> Path:
    """Inside the cache of this state of the package, and named by the line: to compile both takes a minute."""
    digest = hashlib.sha256(Path(three_lumps.__file__).read_bytes()).hexdigest()
    return Path(os.environ["NUMBA_CACHE_DIR"]) / f"three_lumps-{digest[:16]}"


@pytest.mark.slow
def test_simulated_evaluated_and_discovered(tmp_path: Path) -> None:
    """A worn nozzle behind this line: masses right and valid after two events, and its name found."""
    injector, recording = tmp_path / "injector.toml", tmp_path / "worn.csv"
    injector.write_text(NOMINAL_INJECTOR.read_text().replace("[line]\n", '[line]\nmodel = "three_lumps"\n'))

    def command(name: str, *arguments: object) -> str:
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "tests.model.line.command",
                name,
                "--model",
                injector,
                *map(str, arguments),
            ],
            # what is compiled for this test alone need not be fast
            env=os.environ | {"NUMBA_CACHE_DIR": str(own_cache()), "NUMBA_OPT": "1", "PYTHONPATH": str(ROOT)},
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    plant = ("--effect", "orifice_area=0.3", "--measured-rate", "--sample-rate", 50000)
    events = ("--rail-pressure", "60,120", "--energizing-time", 1.1, "--injections", 6, "--period", 50)
    command("simulate", "--output", recording, *plant, *events)
    (found,) = json.loads(command("evaluate", "--json", recording))["recordings"]
    truth = np.genfromtxt(tmp_path / "worn.csv.truth.csv", delimiter=",", names=True)
    density = load_injector().fluid.density_nozzle
    for number, injection in enumerate(found["injections"]):
        window = (truth["time_s"] >= injection["start_s"]) & (truth["time_s"] <= injection["end_s"])
        rate = truth["injection_rate_mm3_per_ms"][window] * 1e-6
        true_mass = np.trapezoid(rate, truth["time_s"][window]) * density * 1e6
        wrong = abs(injection["nominal_mass_mg"] / true_mass - 1.0)
        assert wrong > 0.1
        if number >= 2:
            assert injection["valid"]
            assert injection["mass_mg"] == pytest.approx(true_mass, rel=0.01)
    assert command("discover", "--out", tmp_path / "found", recording).startswith("named: orifice_area")
