"""Terms in force in the observer: the rate is the plant's, and nothing of it is learned once more."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.estimation.parameters import NOZZLE

TERMS = """
[[terms]]
equation = "nozzle_flow"
law = "-0.2 * (injection_number > 1)"

[[terms]]
equation = "line_flow"
law = "c * line_flow"
coefficient = { value = 0.04, unit = "MPa*ms/mm3" }
"""
RINGING = """
[[terms]]
equation = "line_pressure_sensor"
law = "ringing(line_pressure, 7.5, 0.15)"
"""
HELD_OPEN = """
[[terms]]
equation = "needle_lift"
law = "0.001 * closed"
"""
SHARE_MISSING = 0.2  # of the nozzle flow, from the second injection on


def injector_file(folder: Path, terms: str, line: str = "lump") -> Path:
    path = folder / "injector.toml"
    path.write_text(NOMINAL_INJECTOR.read_text().replace('# model = "lump"', f'model = "{line}"  #') + terms)
    return path


def run(path: Path, injections: int) -> tuple[Evaluation, Simulation]:
    """Without noise at 140 MPa, by the injector of a file and observed with it."""
    made = simulate(load_injector(path), make_schedule([140e6], injections, 0.06, [1.1e-3]), 100e3)
    return evaluate(load_bench(model=path), [made.recording], learning=False).evaluations[0], made


@pytest.mark.parametrize(("line", "further"), [("lump", ""), ("lump", RINGING), ("wave", "")])
def test_the_rate_is_that_of_the_plant(tmp_path: Path, line: str, further: str) -> None:
    evaluation, made = run(injector_file(tmp_path, TERMS + further, line), 3)
    assert len(evaluation.reports) == 3
    for report in evaluation.reports:
        window = slice(report.start_index, report.end_index + 1)
        rate, truth = evaluation.trace.injection_rate[window], made.truth.injection_rate[window]
        assert np.sum(rate) == pytest.approx(np.sum(truth), rel=0.004)


@pytest.mark.parametrize("line", ["lump", "wave"])
def test_a_shut_needle_held_open_injects_on(tmp_path: Path, line: str) -> None:
    evaluation, made = run(injector_file(tmp_path, HELD_OPEN, line), 2)
    at_rest = slice(evaluation.reports[0].end_index + 1000, evaluation.reports[1].start_index - 100)
    rate, truth = evaluation.trace.injection_rate[at_rest], made.truth.injection_rate[at_rest]
    assert np.mean(truth) > 1e-9  # 1 mm3/ms
    assert np.mean(rate) == pytest.approx(np.mean(truth), rel=0.01)


def test_what_a_term_says_is_not_learned_again(tmp_path: Path) -> None:
    injector = injector_file(tmp_path, TERMS)
    made = simulate(
        load_injector(injector), make_schedule([140e6, 80e6], 6, 0.06, [1.1e-3]), 100e3, (), SimulatedNoise()
    )
    with_terms, without = (
        evaluate(load_bench(model=model), [made.recording]).evaluations[0].reports[-1].indicators[NOZZLE].value
        for model in (injector, NOMINAL_INJECTOR)
    )
    assert abs(with_terms) < 0.01
    assert without < -0.5 * SHARE_MISSING
