"""Learning from evidence before a model is taken over: the first masses are as good as later ones."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench, load_injector
from observer_rt.daemon.state_file import knowledge_beside, learned_beside
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.desk.take_over import learn_beforehand
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.model.effects import effective_model, sized
from tests.desk.cli.injector_files import amended
from tests.kept_evidence import keep

GAIN = sized("rail_pressure_sensor_gain", g=0.02)
KEPT, RATE = 12, 100e3
RIGHT = 0.0055  # of a mass


def bench_at(folder: Path, lift: str = "") -> Bench:
    text = EXAMPLE_BENCH.read_text().replace('# folder = "evidence"', 'folder = "evidence"')
    text = text.replace("[signals.needle_lift]", f"[signals.needle_lift]\n{lift}")
    (folder / "bench.toml").write_text(text)
    return load_bench(folder / "bench.toml")


def with_gain(folder: Path, g: float = 0.02) -> Path:
    return amended(folder / "amended.toml", GAIN.effect.id, "g", g)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bench file and the evidence of an injector whose rail pressure is seen too large."""
    folder = tmp_path_factory.mktemp("kept")
    keep(bench_at(folder), GAIN, injections=KEPT)
    return folder


@pytest.fixture
def bench(kept: Path, tmp_path: Path) -> Bench:
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)
    return load_bench(tmp_path / "bench.toml")


def begun(path: Path) -> Knowledge | None:
    """What a daemon begins with, its log being read by nobody."""
    return knowledge_beside(path, load_injector(path), lambda _: None)


def masses(bench: Bench, path: Path, knowledge: Knowledge | None) -> tuple[list[bool], list[float]]:
    """Validity, and error of the live mass, of six further injections of the injector whose evidence was kept."""
    schedule = make_schedule([60e6, 100e6, 140e6], 6, 0.05, [0.9e-3, 1.9e-3])
    measured = simulate(load_injector(), schedule, RATE, (GAIN,), SimulatedNoise(), seed=11)
    density = effective_model(load_injector(), (GAIN,)).coefficients.density
    history = evaluate(bench.with_parameters(load_injector(path)), [measured.recording], knowledge)
    valid, errors = [], []
    for report in history.evaluations[0].reports:
        rate = measured.truth.injection_rate[report.start_position : report.end_position + 1]
        valid.append(report.valid)
        errors.append(report.live_mass / (float(np.trapezoid(rate)) / RATE * density) - 1.0)
    return valid, errors


def test_the_first_masses_with_an_amended_model_are_right(bench: Bench, tmp_path: Path) -> None:
    path = with_gain(tmp_path)
    assert learn_beforehand(bench, path) == KEPT
    valid, errors = masses(bench, path, begun(path))
    assert all(valid)
    assert np.abs(errors).max() < RIGHT
    valid, errors_without = masses(bench, path, None)
    assert all(valid)
    assert np.abs(errors_without).max() > np.abs(errors).max()


def test_what_the_bench_file_states_of_the_lift_is_undone_once(bench: Bench, tmp_path: Path) -> None:
    """Evidence holds the lift as the observer saw it."""
    (tmp_path / "late").mkdir()
    late = bench_at(tmp_path / "late", "lag_us = 30")
    keep(late, GAIN, sized("needle_lift_sensor_lag", tau=30e-6), injections=KEPT)
    results = []
    for variant in (bench, late):
        path = with_gain(variant.path.parent)
        assert learn_beforehand(variant, path) == KEPT
        knowledge = begun(path)
        assert knowledge is not None
        results.append(knowledge)
    without, with_lag = (knowledge.in_force for knowledge in results)
    sigma = np.sqrt(np.diag(results[0].state.learned.belief.covariance))
    np.testing.assert_array_less(np.abs(without - with_lag), 1.5 * sigma)


def test_nothing_is_begun_with_where_the_model_does_not_explain_the_evidence(bench: Bench, tmp_path: Path) -> None:
    path = with_gain(tmp_path, g=-0.02)
    learned_beside(path).write_text("left by an earlier step")
    assert learn_beforehand(bench, path) == 0
    assert not learned_beside(path).exists()


@pytest.mark.parametrize("content", ['{"version": 1}', "no learned state"])
def test_a_damaged_file_is_told_and_left_alone(tmp_path: Path, content: str) -> None:
    path, messages = with_gain(tmp_path), list[str]()
    learned_beside(path).write_text(content)
    assert knowledge_beside(path, load_injector(), messages.append) is None
    assert "learning begins anew" in messages[0]
    assert learned_beside(path).read_text() == content


def test_evidence_of_another_model_teaches_nothing(bench: Bench, tmp_path: Path) -> None:
    other = bench.with_parameters(load_injector(with_gain(tmp_path, 0.01)))
    assert learn_beforehand(other, with_gain(tmp_path)) == 0
