"""Missing laws in equations that have nothing to do with an injector: friction, hares and lynxes, tanks."""

import os
import re
import shutil
import subprocess
import sys
from math import exp
from pathlib import Path

import numpy as np
import pytest

from observer_rt.foundation.errors import UserError
from observer_rt.identification.ode import CandidateLaw, OdeModel, OdeRecording, common_laws, find_terms
from tests.pages import Page

PAGE = Page("docs/library.md")
TANKS = PAGE.fenced("python")[-1]
MASS, VISCOUS, COULOMB = 2.0, 12.0, 20.0
NOISE = 1e-4  # m
# hares and lynxes of which the Hudson's Bay Company bought the pelts, thousands a year, 1900 to 1920
PELTS = np.array(
    [
        (30, 4),
        (47.2, 6.1),
        (70.2, 9.8),
        (77.4, 35.2),
        (36.3, 59.4),
        (20.6, 41.7),
        (18.1, 19),
        (21.4, 13),
        (22, 8.3),
        (25.4, 9.1),
        (27.1, 7.4),
        (40.3, 8),
        (57, 12.3),
        (76.6, 19.5),
        (52.3, 45.7),
        (19.5, 51.1),
        (11.2, 29.7),
        (7.6, 15.8),
        (14.6, 9.7),
        (16.2, 10.1),
        (24.7, 8.6),
    ]
)
AXIS = OdeModel(
    lambda x, u, p: (x.v, (u.force - p.viscous * x.v) / p.mass),
    states={"x": 0.0, "v": 0.0},
    parameters={"mass": 3.0, "viscous": 5.0},
)


def axis(coulomb: float, samples: int = 500) -> OdeRecording:
    """Position of an axis that a force drives to and fro, in steps of a twentieth of a sample."""
    time = np.arange(samples, dtype=np.float64) * 1e-3
    force = 60.0 * np.sign(np.sin(20.0 * time)) * (0.5 + time) + 40.0 * np.sin(44.0 * time)
    x, v, position = 0.0, 0.0, np.zeros(samples)
    for k in range(samples):
        position[k] = x
        for _ in range(20):
            v += 5e-5 * (force[k] - VISCOUS * v - coulomb * np.tanh(v / 1e-3)) / MASS
            x += 5e-5 * v
    position += NOISE * np.random.default_rng(1).normal(size=samples)
    return OdeRecording(time, {"x": position}, {"force": np.asarray(force, np.float64)})


@pytest.mark.parametrize("sigma", [{"x": NOISE}, None])
def test_coulomb_friction_is_found_and_mass_and_damping_with_it(sigma: dict[str, float] | None) -> None:
    """Neither is known: without friction in the model both are far off."""
    recording = axis(COULOMB)
    laws = [
        CandidateLaw("v", "sign(v)", lambda x, u: float(np.sign(x.v))),
        CandidateLaw("v", "v*abs(v)", lambda x, u: x.v * abs(x.v)),
        CandidateLaw("v", "x", lambda x, u: x.x),
        CandidateLaw("v", "1", lambda x, u: 1.0),
    ]
    found = find_terms(AXIS, [recording], laws, sigma)
    first = found.laws[0]
    assert (first.equation, first.law) == ("v", "sign(v)")
    assert first.coefficient.value == pytest.approx(-COULOMB / MASS, rel=0.03)
    assert found.parameters["mass"].value == pytest.approx(MASS, rel=0.02)
    assert found.parameters["viscous"].value == pytest.approx(VISCOUS, rel=0.1)
    assert found.sigma["x"] == pytest.approx(NOISE, rel=0.15)
    assert found.noise_is_given == (sigma is not None)
    before, after = found.held_out
    assert after < 0.1 * before
    assert "missing: v' += c * sign(v), c = -" in repr(found)


def test_nothing_is_found_where_nothing_is_missing() -> None:
    recording = axis(0.0)
    found = find_terms(
        AXIS, [recording], [one for one in common_laws(AXIS, [recording], ["v"]) if not one.numbers]
    )
    assert found.laws == ()
    assert found.explained
    assert found.parameters["mass"].value == pytest.approx(MASS, rel=2e-3)
    assert found.parameters["mass"].high - found.parameters["mass"].low < 0.01
    assert "nothing is missing" in repr(found)
    assert "not all is explained" not in repr(found)


def test_common_laws_are_of_every_state_and_input_of_the_equations_asked_for() -> None:
    laws = common_laws(AXIS, [axis(COULOMB)], ["v"])
    assert {one.equation for one in laws} == {"v"}
    words = {one.words for one in laws}
    assert {"1", "x", "sign(v)", "v*abs(v)", "v^2", "max(v - {}, 0)", "force^3", "x*v"} <= words


def test_signals_that_do_not_fit_are_refused() -> None:
    time = np.arange(10.0)
    law = [CandidateLaw("v", "1", lambda x, u: 1.0)]
    for recording, said in [
        (OdeRecording(time, {"x": np.zeros(9)}, {"force": time}), "'x': has 9 samples"),
        (OdeRecording(time**2, {"x": time}, {"force": time}), "time: is not even"),
        (OdeRecording(time, {"y": time}, {"force": time}), "not among the states"),
        (OdeRecording(time, {"x": time}, {"force": time}, {"x": "x0"}), "is no parameter 'x0'"),
    ]:
        with pytest.raises(UserError, match=re.escape(said)):
            find_terms(AXIS, [recording], law, sigma={"x": NOISE, "y": NOISE})
    with pytest.raises(UserError, match="noise of 'x': cannot be measured"):
        find_terms(AXIS, [OdeRecording(time, {"x": time}, {"force": time})], law)


def printed(program: str, folder: Path) -> str:
    return subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True
    ).stdout


def test_pelts_of_hares_and_lynxes_ask_for_nothing_more() -> None:
    """The equations of Lotka and Volterra in logarithms; their parameters as published for these years."""
    pelts = OdeRecording(np.arange(1900.0, 1921.0), dict(zip(("hare", "lynx"), np.log(PELTS.T), strict=True)))
    model = OdeModel(
        lambda x, u, p: (p.born - p.eaten * exp(x.lynx), p.fed * exp(x.hare) - p.dies),
        states={"hare": "hare_start", "lynx": "lynx_start"},
        parameters={
            "born": 0.5,
            "eaten": 0.02,
            "fed": 0.02,
            "dies": 0.8,
            "hare_start": 3.4,
            "lynx_start": 1.4,
        },
        steps=4,
    )
    laws = [
        law
        for equation in ("hare", "lynx")
        for law in (
            CandidateLaw(equation, "hares", lambda x, u: exp(x.hare)),
            CandidateLaw(equation, "lynxes", lambda x, u: exp(x.lynx)),
            CandidateLaw(equation, "lynxes/hares", lambda x, u: exp(x.lynx - x.hare)),
        )
    ]
    found = find_terms(model, [pelts], laws, sigma={"hare": 0.25, "lynx": 0.25})
    assert found.laws == ()
    assert repr(found).startswith("nothing is missing that these laws say\n")
    for name, published in {"born": 0.55, "eaten": 0.028, "fed": 0.024, "dies": 0.80}.items():
        assert found.parameters[name].low < published < found.parameters[name].high


@pytest.mark.slow
def test_the_overflow_of_measured_tanks_is_found(tmp_path: Path) -> None:
    file = Path(os.environ.get("OBSERVER_RT_TEST_DATA", "."), "cascaded_tanks.csv")
    if not file.is_file():
        pytest.skip(
            "OBSERVER_RT_TEST_DATA names no folder with cascaded_tanks.csv (4TU.ResearchData 10.4121/12960104)"
        )
    shutil.copy(file, tmp_path)
    first, second, *_ = said = printed(TANKS, tmp_path).splitlines()
    assert first.startswith("missing: upper' += c * max(upper - ")
    assert second.startswith("missing: lower' += c * max(upper - ")
    (errors,) = [re.findall(r"[\d.]+(?= times| after)", line) for line in said if line.startswith("held out")]
    before, after = map(float, errors)
    assert after < 0.65 * before
    assert [re.sub(r"[\d.]+", "", line) for line in PAGE_SAYS[:2]] == [
        re.sub(r"[\d.]+", "", line) for line in (first, second)
    ]


(PAGE_SAYS,) = (block.splitlines() for block in PAGE.indented() if block.startswith("missing: "))
