"""The ablation: a batch learner that learns what the observer's does, and variants that differ where they say."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Setting
from observer_rt.engine.estimation.scalars import PARAMETERS, Parameter
from observer_rt.engine.service.constants import bench_constants, configured_noise
from tools.benchmarks.ablation import (
    BATCHES,
    VARIANTS,
    AblationScore,
    VariantScore,
    ablation_document,
    ablation_tables,
    listened,
)
from tools.benchmarks.batch_learning import (
    SeenEvent,
    learn_events,
    shipped_model,
    tied_rows_model,
    trained_hidden_model,
)
from tools.benchmarks.cases import make_case
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.score import OBSERVER, CaseScore, windows_of
from tools.benchmarks.scoring import bench_at

BENCH = bench_at(100e3)
CONSTANTS = bench_constants(BENCH.injector)
SCALE = CONSTANTS.coefficients.pressure_scale
GAIN = np.array([0.05, 0.06, 0.03])
SETTING = Setting(CONSTANTS.interval, CONSTANTS.substeps, CONSTANTS.coefficients, GAIN)
SIGMA = 1.5e-3
BURN_IN = 50


Worn = tuple[Outcome, CaseScore, tuple[SeenEvent, ...]]


@pytest.fixture(scope="module")
def worn() -> Worn:
    """Five events of a worn nozzle, as the observer's learner was given them."""
    case = make_case("orifice_area", 1, 0)
    case = replace(case, bench=replace(case.bench, events=case.bench.events[:5]))
    outcome = record(case.bench)
    return outcome, *listened(case, outcome)


def theta_of(**values: float) -> NDArray[np.float64]:
    theta = np.zeros(PARAMETERS)
    for name, value in values.items():
        theta[Parameter[name]] = value
    return theta


def test_events_lie_where_their_windows_say(worn: Worn) -> None:
    outcome, _, events = worn
    assert len(events) == 5
    chamber = CONSTANTS.coefficients.chamber_pressure
    for event in events:
        measured = outcome.measured.line_pressure[event.first : event.first + event.window.output.size]
        np.testing.assert_allclose(event.window.output * SCALE + chamber, measured, atol=1.0)


@pytest.mark.parametrize("name", BATCHES)
def test_batches_learn_wear_within_two_events(name: str, worn: Worn) -> None:
    outcome, shipped, events = worn
    model_of, search = BATCHES[name]
    noise = configured_noise(BENCH.injector)
    found = learn_events(model_of(SCALE), search, events, outcome.measured.time.size, CONSTANTS, noise)
    masses = windows_of(outcome, 100e3).event_masses_mg(found.rate, 830.0)
    errors = 100.0 * np.abs(np.array(masses) / np.array(shipped.true_mass_mg) - 1.0)
    assert errors[0] > 10.0  # nothing learned yet
    assert errors[2:].max() < 1.0
    assert np.abs(np.array(masses) / np.array(shipped.estimator(OBSERVER).mass_mg) - 1.0)[2:].max() < 0.01
    assert min(found.training_ms) > 0.0


def test_differences_and_sensitivities_are_one_gradient(worn: Worn) -> None:
    window = worn[2][2].window
    theta = theta_of(NOZZLE_BIAS=0.2, NOZZLE_WEIGHT=0.05, LINE_FRICTION=0.3, SENSOR_LAG=0.1)
    exact = shipped_model(SCALE).cost(window, SETTING, SIGMA, BURN_IN).linearised(theta)
    differenced = (
        trained_hidden_model(SCALE)
        .cost(window, SETTING, SIGMA, BURN_IN)
        .linearised(np.append(theta, np.zeros(trained_hidden_model(SCALE).prior.size - PARAMETERS)))
    )
    assert differenced.value == pytest.approx(exact.value)
    scale = np.sqrt(np.diag(exact.information))
    np.testing.assert_allclose(
        differenced.gradient[:PARAMETERS] / scale,
        exact.gradient / scale,
        atol=0.01 * abs(exact.gradient / scale).max(),
    )
    weighted = np.abs(differenced.gradient[PARAMETERS:])
    assert weighted[:6].max() > 0.0  # of the only neuron with weight
    assert weighted[6:].max() == 0.0


def test_tied_rows_are_the_model_itself_at_zero_and_leave_it_with_the_bias(worn: Worn) -> None:
    window = worn[2][2].window
    shipped, tied = shipped_model(SCALE), tied_rows_model(SCALE)
    for line in (theta_of(), theta_of(LINE_FRICTION=0.5, LINE_PRESSURE_OFFSET=0.005, SENSOR_LAG=0.2)):
        values = [m.cost(window, SETTING, SIGMA, BURN_IN).value(line) for m in (shipped, tied)]
        assert values[1] == pytest.approx(values[0], rel=1e-3)
    opened = window.inputs[:, 1] > 0.5
    rates = [m.rate(window, SETTING, theta_of(NOZZLE_BIAS=0.2))[opened].mean() for m in (shipped, tied)]
    nominal = shipped.rate(window, SETTING, theta_of())[opened].mean()
    assert rates[0] > 1.1 * nominal
    assert rates[1] > 1.1 * nominal


def test_tables_and_data_name_every_variant() -> None:
    def scored(class_name: str, error: float) -> AblationScore:
        observers = (VariantScore(n, error, 0.2, 0.9, 1, (5.0, 7.0)) for n in VARIANTS if n not in BATCHES)
        batches = (VariantScore(n, -2.0 * error, 0.4, None, None, (9.0,)) for n in BATCHES)
        return AblationScore(class_name, 1, 0, (*observers, *batches))

    scores = [scored("healthy", 0.1), scored("orifice_area", 0.3)]
    overall, by_class = ablation_tables(scores)
    rows = list(zip(*(column.cells for column in overall.columns), strict=True))
    assert [row[0] for row in rows] == list(VARIANTS)
    assert rows[0][1:] == ("0.200", "0.290", "0.300", "0.200", "90.0", "2", "6.0")
    assert rows[-1][1:] == ("0.400", "0.580", "0.600", "0.400", "-", "-", "9.0")
    assert next(iter(by_class.columns[2].cells)) == "0.300"
    document = json.loads(json.dumps(ablation_document(scores, [])))
    assert set(document["figures"]["mass_error_p95_pct"]) == set(VARIANTS)
    assert document["details"]["classes"]["healthy"][VARIANTS[-1]]["valid_share"] is None
