"""What `check` says of a learned state and of an injector's parameters, whatever they hold."""

from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench, load_injector
from observer_rt.daemon.state_file import model_hash, save_knowledge
from observer_rt.desk.check.bench_rules import checkup
from observer_rt.desk.check.findings import Finding, Level
from observer_rt.engine.learning.knowledge import Knowledge, no_knowledge
from observer_rt.engine.service.noise import configured_noise
from observer_rt.model.parameters import LineOutflow
from tests.daemon.samples import PRESSURE_SCALE, some_knowledge

MODEL = load_injector()


def of_state(path: Path, bench: Path = EXAMPLE_BENCH) -> Finding:
    (finding,) = (f for f in checkup(load_bench(bench), path) if f.topic == "learned state")
    return finding


def test_without_a_state_nothing_is_said_of_it() -> None:
    assert not [f for f in checkup(load_bench()) if f.topic == "learned state"]


@pytest.mark.parametrize(
    ("knowledge", "level", "said"),
    [
        (None, Level.OK, "begins with the prior"),
        (some_knowledge(phi_version=7, events=20), Level.OK, "correction 7, learned from 20 events"),
        (no_knowledge(configured_noise(load_bench().injector), PRESSURE_SCALE), Level.WARNING, "no sooner"),
    ],
    ids=["not there yet", "fits", "learned from nothing"],
)
def test_a_state_of_this_model(tmp_path: Path, knowledge: Knowledge | None, level: Level, said: str) -> None:
    path = tmp_path / "state.json"
    if knowledge is not None:
        save_knowledge(path, knowledge, MODEL)
    finding = of_state(path)
    assert finding.level is level
    assert said in finding.text


def test_a_state_of_another_model(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    other = MODEL.model_copy(update={"line_outflow": LineOutflow.SEAT})
    save_knowledge(path, some_knowledge(), other)
    finding = of_state(path)
    assert finding.level is Level.WARNING
    hashes = f"SHA-256 {model_hash(other)[:8]}... instead of {model_hash(MODEL)[:8]}..."
    assert f"another injector model, {hashes}" in finding.text
    assert "name the model file it belongs to" in finding.text


@pytest.mark.parametrize("location", ["no/state.json", "."])
def test_a_state_that_run_would_refuse(tmp_path: Path, location: str) -> None:
    assert of_state(tmp_path / location).level is Level.ERROR
