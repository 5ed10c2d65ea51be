"""A feed line is one file: a second one, with four states more, simulated, observed, learned with and discovered.

The commands run in processes of their own, with a cache of compiled code that only they use: nobody else's may name
a line that only tests have.
"""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.line import lump
from observer_rt.model.line.interface import no_slopes
from tests.model.line import three_lumps
from tests.model.line.three_lumps import ThreeLumps
from tests.model.test_derivatives import PRESSURE, beside, difference

ROOT = Path(__file__).parents[3]
ROWS = [0, 1, 3, 4, 5, 6]  # of x, all but p_S's
FLOW = st.floats(-1.5, 1.5)
UNCHANGED = {"stiffness_pressure", "chamber_pressure"}  # nothing changes them


@pytest.fixture(scope="module")
def uncompiled() -> Iterator[None]:
    """The laws as plain Python."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (lump, three_lumps):
            for name, value in list(vars(module).items()):
                if hasattr(value, "py_func"):
                    patch.setattr(module, name, value.py_func)
        yield


def line() -> Any:
    """With leakage, air and a stiffness that bends."""
    injector = load_injector()
    named = injector.model_copy(
        update={"line": injector.line.model_copy(update={"model": "three_lumps"}), "line_outflow": "seat"}
    )
    departures = [
        sized("guide_leakage", c=2e-14),
        sized("pressure_dependent_bulk_modulus", n=8.0),
        sized("entrained_air", g=0.02),
    ]
    return effective_model(named, departures).coefficients.line


@settings(deadline=None)
@given(st.tuples(PRESSURE, FLOW, PRESSURE, PRESSURE, FLOW, PRESSURE, FLOW), PRESSURE, FLOW, FLOW)
def test_slopes(uncompiled: None, x: Sequence[float], rail: float, q_h: float, q_s: float) -> None:
    """Against differences of the rates, into slopes that an earlier call has left."""
    c = line()
    assume(all(abs(x[i] + c.chamber_pressure - lump.LOWEST_PRESSURE) > 1e-4 for i in (0, 3, 5)))
    assume(all(abs(x[i]) > 1e-4 for i in (1, 4, 6)))
    found = no_slopes(c)
    for left in ((1.0,) * 7, x):
        three_lumps.slopes(left, rail, q_h, q_s, c, found)

    def check(slopes: NDArray[np.float64], law: Callable[[float], Sequence[float]]) -> None:
        np.testing.assert_allclose(slopes[ROWS], difference(law), rtol=1e-5, atol=1e-3)

    def by_state(place: int, d: float) -> Sequence[float]:
        return tuple(three_lumps.rates(beside(x, place, d), rail, q_h, q_s, c))

    def by_coefficient(place: int, d: float) -> Sequence[float]:
        return tuple(three_lumps.rates(x, rail, q_h, q_s, ThreeLumps(*beside(c, place, d))))

    for place in range(7):
        check(found.by_state[:, place], partial(by_state, place))
    check(found.by_rail, lambda d: three_lumps.rates(x, rail + d, q_h, q_s, c))
    check(found.by_flow[:, 0], lambda d: three_lumps.rates(x, rail, q_h + d, q_s, c))
    check(found.by_flow[:, 1], lambda d: three_lumps.rates(x, rail, q_h, q_s + d, c))
    for place, name in enumerate(ThreeLumps._fields):
        if name not in UNCHANGED:
            check(found.by_coefficient[:, place], partial(by_coefficient, place))


def test_transition(uncompiled: None) -> None:
    """Against the rates integrated, of a line with neither friction nor anything else."""
    c = line()._replace(a4=0.0, leak=0.0, air=0.0, stiffness_slope=0.0)
    interval = 2e-5
    matrix, rail = c.transition(interval)
    start = np.array([0.3, -0.2, 0.5, 0.1, 0.8, 0.4])

    def moving(_: float, x: NDArray[np.float64]) -> Sequence[float]:
        return tuple(three_lumps.rates((*x[:2], 0.0, *x[2:]), 0.9, 0.0, 0.0, c))

    end = solve_ivp(moving, (0.0, interval), start, rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(matrix @ start + 0.9 * rail, end, atol=1e-7)
    slowest = np.abs(np.log(np.linalg.eigvals(matrix)).imag).min() / interval
    assert c.mode == pytest.approx(slowest, rel=1e-6)


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
