"""`training = "paper"` through bus codec, core and hot path."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector import LearningConfig, Training
from observer_rt.desk.check.checkup import Level, checkup
from observer_rt.desk.evaluation.command import evaluate_files
from observer_rt.desk.evaluation.evaluate import Evaluation, evaluate
from observer_rt.desk.evaluation.options import EvaluateOptions
from observer_rt.desk.paper.study import InjectionWindow, injection_windows
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import Simulation, simulate
from observer_rt.engine.estimation.scalars import NOZZLE
from observer_rt.engine.paper_scheme.systems import swept
from observer_rt.engine.paper_scheme.training import first_weights, network_of, train
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.model.effects import sized
from observer_rt.model.parameters import LineOutflow
from tests.engine.paper_scheme.conftest import SAMPLE_RATE, Injection, make_injection

pytestmark = pytest.mark.slow  # compiles what only these tests call, or is a whole closed loop

EVENTS = 6
WEAR = 0.5


def paper_bench(gain: float = 1e5) -> Bench:
    return load_bench().with_sections(
        learning=LearningConfig(training=Training.PAPER, identification_gain=gain)
    )


@cache
def simulated() -> Simulation:
    schedule = make_schedule([100e6], EVENTS, 0.04, [1.9e-3])
    return simulate(
        load_bench().injector.parameters, schedule, SAMPLE_RATE, (sized("orifice_area", v_H=WEAR),)
    )


@cache
def evaluated() -> Evaluation:
    (evaluation,) = evaluate(paper_bench(), [simulated().recording]).evaluations
    return evaluation


@cache
def windows() -> list[InjectionWindow]:
    return injection_windows(simulated().truth.needle_lift, SAMPLE_RATE)


def mass_error(window: InjectionWindow) -> float:
    estimated, true = evaluated().trace.injection_rate, simulated().truth.injection_rate
    return float(estimated[window.span].sum() / true[window.span].sum()) - 1.0


def test_before_the_first_training_it_is_the_model() -> None:
    trace, span = evaluated().trace, windows()[0].span
    # the nominal model empties the sac behind the shut needle, this x^ lets it drain
    np.testing.assert_allclose(
        trace.injection_rate[span], trace.nominal_rate[span], rtol=1e-12, atol=1e-4 * MM3_PER_MS
    )
    assert not trace.phi[span].any()


def test_hot_path_is_the_pass_of_the_training() -> None:
    """x^, phi and rate of the second injection as a sweep over it with the weights of the first training."""
    first: Injection = make_injection(WEAR)
    setting = first.setting()
    weights = train(first.window, setting, first_weights()).weights
    seen = swept(first.window, setting, network_of(weights, setting))
    trace, second = evaluated().trace, windows()[1]
    opened = slice(first.scored.start + 15, first.scored.stop)
    live = slice(second.opening, second.last)
    np.testing.assert_allclose(
        trace.x[live, 2], seen.x[opened, 2], atol=0.03
    )  # the line still rings a little
    np.testing.assert_allclose(trace.phi[live, 0], seen.phi[opened, 0], atol=20)
    volume = [rate.sum() for rate in (trace.injection_rate[live], seen.rate[opened])]
    assert volume[0] == pytest.approx(volume[1], rel=0.01)


def test_rate_is_the_balance_of_x_3_and_phi_1() -> None:
    c_rate = evaluated().trace
    x_3, phi_1 = c_rate.x[windows()[2].span, 2], c_rate.phi[windows()[2].span, 0]
    # (Q_0/a_1)(a_2 root(x_3) - phi_1) of the nominal injector: 69.5 mm3/ms at p_0, 56.25 mm3 for each of phi_1
    expected = 69.53e-6 * x_3 / (x_3**2 + 0.005**2) ** 0.25 - 56.25e-9 * phi_1
    np.testing.assert_allclose(c_rate.injection_rate[windows()[2].span], expected, atol=0.02e-6)


def test_the_line_is_free_of_phi_once_the_needle_is_long_shut() -> None:
    trace = evaluated().trace
    resting = slice(windows()[1].shut + round(4e-3 * SAMPLE_RATE), windows()[2].opening - 10)
    assert not trace.phi[resting].any()
    assert not trace.injection_rate[resting].any()


def test_training_halves_the_error_and_leaves_the_rest() -> None:
    errors = [mass_error(window) for window in windows()]
    assert errors[0] == pytest.approx(-0.297, abs=0.01)
    for error in errors[1:]:
        assert -0.15 < error < -0.03


def test_only_trainings_that_lower_the_output_error_are_adopted() -> None:
    counters = evaluated().counters
    assert counters.adoptions >= 1
    assert counters.adoptions + counters.rejected_adoptions == EVENTS
    error = simulated().recording.line_pressure - (evaluated().trace.x[:, 0] * 100e6 + 5e6)
    squares = [np.mean(error[window.span] ** 2) for window in windows()]
    assert max(squares[1:]) < 0.5 * squares[0]


def test_nothing_it_says_counts_as_valid() -> None:
    reports = evaluated().reports
    assert not evaluated().trace.valid.any()
    assert [report.reason for report in reports[2:]] == [Reason.UNTESTED] * (EVENTS - 2)
    assert all(report.mass_ci95 is None for report in reports)


def test_wear_indicator_is_read_from_phi() -> None:
    last = evaluated().reports[-1].indicators
    assert 0.25 < last[NOZZLE].value < WEAR
    assert last[NOZZLE].sigma is None


def test_it_repeats_itself_bit_for_bit() -> None:
    (again,) = evaluate(paper_bench(), [simulated().recording]).evaluations
    assert again.trace.injection_rate.tobytes() == evaluated().trace.injection_rate.tobytes()


def test_gain_that_does_not_fit_the_sample_rate_is_refused() -> None:
    bench = paper_bench(3e5)
    with pytest.raises(UserError, match="faster than the samples") as refused:
        Core(bench.injector, map_bus(bench))
    assert refused.value.place.endswith("learning.identification_gain")


def test_line_drained_by_the_seat_is_refused() -> None:
    bench = paper_bench()
    seat = bench.injector.parameters.model_copy(update={"line_outflow": LineOutflow.SEAT})
    bench = bench.with_parameters(seat)
    with pytest.raises(UserError, match="line_outflow = 'seat'"):
        Core(bench.injector, map_bus(bench))


@pytest.mark.parametrize("option", ["--state", "--save-state"])
def test_state_is_neither_restored_nor_saved(tmp_path: Path, option: str) -> None:
    file = tmp_path / "state.json"
    state, save_state = (file, None) if option == "--state" else (None, file)
    options = EvaluateOptions((tmp_path / "recording.csv",), state=state, save_state=save_state)
    with pytest.raises(UserError, match="keeps nothing") as refused:
        evaluate_files(paper_bench(), options, Console(stderr=True))
    assert refused.value.place == option


@pytest.mark.parametrize(("gain", "level"), [(5e4, Level.OK), (1e5, Level.WARNING), (2e5, None)])
def test_check_says_what_to_think_of_the_gain(gain: float, level: Level | None) -> None:
    findings = {finding.topic: finding for finding in checkup(paper_bench(gain))}
    if level is None:
        assert findings["training"].level is Level.ERROR
        assert "faster than the samples" in findings["training"].text
    else:
        assert findings["identification gain"].level is level
        assert findings["training"].level is Level.WARNING


def test_check_says_nothing_of_a_training_that_is_not_used() -> None:
    assert not {"training", "identification gain"} & {finding.topic for finding in checkup(load_bench())}
