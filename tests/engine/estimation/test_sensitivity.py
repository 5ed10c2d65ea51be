"""The filtered gradient against differences of the innovations themselves."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.parameters import EVERY, LAWLESS, NEEDLE_LAW, PARAMETERS, Parameter
from observer_rt.engine.estimation.predictor import Window, innovations_with_sensitivity
from observer_rt.model.effective import LAG_UNIT
from tests.differences import assert_columns_agree, differences
from tests.engine import conftest
from tests.engine.conftest import Case, event_inputs, innovations_at, simulated_event, worn_theta
from tests.model.conftest import with_line
from tests.plants.arrays import Array

HEALTHY = np.zeros(PARAMETERS)
FLOW = list(range(Parameter.LINE_PRESSURE_OFFSET))  # nozzle and seat
VALVE = list(range(Parameter.CONTROL_START, Parameter.DISPLACEMENT))  # does nothing without flow
NEEDLE = NEEDLE_LAW.columns.tolist()
SERVO = worn_theta()
SERVO[Parameter.CONTROL_FLOW : Parameter.DISPLACEMENT + 1] = 0.08, 0.3, -0.4, 0.2, -0.3, 0.02
QUICK = worn_theta()
QUICK[Parameter.SENSOR_LAG] = 5e-9 / LAG_UNIT  # far shorter than a sample: another branch of the sensor


def with_slopes(case: Case, window: Window, theta: Array, columns: NDArray[np.int64] = EVERY) -> tuple[Array, Array]:
    result = np.empty(window.output.size)
    slopes = np.empty((window.output.size, columns.size))
    innovations_with_sensitivity(window, case.setting, theta, result, slopes, columns)
    return result, slopes


def assert_slopes(case: Case, window: Window, theta: Array, by_corners: float = 0.2, share: float = 1e-6) -> None:
    """Against differences of the innovations by every parameter; by_corners: share of a lift's move."""
    _, slopes = with_slopes(case, window, theta)
    expected = differences(lambda moved: innovations_at(case, window, moved), theta, 1e-5)
    moves = np.abs(expected).max(axis=0) > 0.0
    still = {*VALVE, *(NEEDLE if window.needle is None else [Parameter.LIFT_DELAY])}
    assert moves[[p for p in range(PARAMETERS) if p not in still]].all()
    assert moves[VALVE].all() == (theta[Parameter.CONTROL_FLOW] > 0.0)
    assert_columns_agree(slopes[:, conftest.SMOOTH], expected[:, conftest.SMOOTH], share)
    _, by_lawless = with_slopes(case, window, theta, LAWLESS)
    np.testing.assert_array_equal(by_lawless, slopes[:, LAWLESS])
    if window.needle is not None:
        return
    move = np.eye(PARAMETERS)[Parameter.LIFT_DELAY] * 5e-6 / LAG_UNIT
    moved = innovations_at(case, window, theta + move) - innovations_at(case, window, theta - move)
    predicted = slopes @ (2.0 * move)
    assert np.linalg.norm(moved - predicted) < by_corners * np.linalg.norm(moved)


@pytest.mark.parametrize(
    "theta", [HEALTHY, worn_theta(), QUICK, SERVO], ids=["healthy", "worn", "quick sensor", "servo"]
)
def test_slopes_are_the_derivatives_of_the_innovations(case: Case, theta: Array) -> None:
    """At another pressure than 100 MPa, at which no exponent tells."""
    assert_slopes(case, simulated_event(case, worn_theta(seed=7), event_inputs(rail=0.7), seed=3), theta)


def test_slopes_with_effects_in_force(affected: Case) -> None:
    """Everything the right-hand side may be asked for at once, and a slow sensor recorded late."""
    assert_slopes(affected, simulated_event(affected, worn_theta(seed=7), event_inputs(), seed=3), worn_theta())


def commanded(case: Case, line: str, commands: list[tuple[float, float]]) -> tuple[Case, Window]:
    injector = load_injector()
    window = simulated_event(case, worn_theta(seed=7), event_inputs(rail=0.7), seed=3)
    if line == "wave":
        case = conftest.make_case(with_line(injector, model="wave"))
        window = window._replace(start=conftest.start_at_rest(case.c, 0.7))
    return case, window._replace(needle=injector.needle_law, commands=np.array(commands))


@pytest.mark.parametrize("commands", [[(80.0, 190.0)], [(80.0, 120.0), (230.0, 245.0)]], ids=["stop", "ballistic"])
@pytest.mark.parametrize("line", ["lump", "wave"])
def test_slopes_of_a_needle_that_answers_commands(case: Case, line: str, commands: list[tuple[float, float]]) -> None:
    """Its area is computed with theta: all slopes are exact, those by its delays and speeds, too."""
    case, window = commanded(case, line, commands)
    theta = worn_theta()
    theta[NEEDLE] = 0.2, 0.1, -0.3, -0.1, 1.2, 0.1, 0.15
    assert_slopes(case, window, theta, share=5e-4)  # a drained sac is empty from one sample to the next


@pytest.mark.parametrize("line", ["lump", "wave"])
def test_a_needle_that_does_not_bounce_shows_what_a_bounce_would_do(case: Case, line: str) -> None:
    case, window = commanded(case, line, [(80.0, 190.0)])
    theta, bounce = worn_theta(), np.eye(PARAMETERS)[Parameter.LANDING_BOUNCE]
    theta[Parameter.BACK_PRESSURE : Parameter.BACK_PRESSURE + 2] = 0.0  # it rises at once with the smallest bounce
    here, slopes = with_slopes(case, window, theta)
    moved = (innovations_at(case, window, theta + 1e-3 * bounce) - here) / 1e-3
    assert np.linalg.norm(moved) > 1e-3
    assert np.linalg.norm(moved - slopes @ bounce) < 0.1 * np.linalg.norm(moved)


def test_slopes_with_a_lift_sampled_between(case: Case) -> None:
    assert_slopes(case, lift_sampled_between(case), worn_theta())


def lift_sampled_between(case: Case) -> Window:
    """An event whose area bends 0.3 of an interval after every sample, by up to a tenth."""
    window = simulated_event(case, worn_theta(seed=7), event_inputs(), seed=3)
    area = window.inputs[:, 1]
    bends = area + 0.3 * np.append(np.diff(area), 0.0) + 0.1 * (area > 0.0) * np.cos(np.arange(area.size))
    return window._replace(knots=np.column_stack([np.full(area.size, 0.3), bends]))


def test_a_lift_sampled_between_moves_the_innovations(case: Case) -> None:
    """With and without slopes alike, and not so where the needle is shut."""
    window, theta = lift_sampled_between(case), worn_theta()
    bent = innovations_at(case, window, theta)
    np.testing.assert_array_equal(with_slopes(case, window, theta)[0], bent)
    straight = innovations_at(case, window._replace(knots=np.empty((0, 2))), theta)
    np.testing.assert_array_equal(bent[: window.opening], straight[: window.opening])
    assert np.abs(bent - straight).max() > 5e-4


def test_nothing_flows_and_nothing_is_learned_while_shut(case: Case) -> None:
    """Before the opening no flow parameter moves an innovation; line and sensor do."""
    window = simulated_event(case, worn_theta(), event_inputs(), seed=3)
    _, slopes = with_slopes(case, window, worn_theta())
    shut = slopes[1 : window.opening]
    assert not shut[:, FLOW].any()
    others = [p for p in range(Parameter.CONTROL_FLOW) if p not in FLOW]
    assert shut[1:, others].all()  # the lag from the second sample on


@pytest.mark.parametrize("delay", [-30e-6, 4e-6, 17e-6])
def test_the_true_delay_of_the_lift_leaves_least(case: Case, delay: float) -> None:
    """The corners between samples leave the rest."""
    theta, window = worn_theta(), simulated_event(case, worn_theta(), event_inputs())
    late = conftest.recorded_late(window, delay / case.setting.interval)
    tried = delay + np.array([-10e-6, -2e-6, 0.0, 2e-6, 10e-6])
    moves = np.outer(tried / LAG_UNIT, np.eye(PARAMETERS)[Parameter.LIFT_DELAY])
    left = [np.linalg.norm(innovations_at(case, late, theta + move)) for move in moves]
    assert np.argmin(left) == 2
    assert left[2] < 0.2 * np.linalg.norm(innovations_at(case, late, theta))


def test_effects_in_force_are_part_of_the_truth(affected: Case) -> None:
    """None of the sensor's terms may be left out."""
    theta = worn_theta()
    window = simulated_event(affected, theta, event_inputs())
    assert np.abs(innovations_at(affected, window, theta)).max() < 1e-12
    setting = affected.setting
    for other in (setting._replace(late=0.0), setting._replace(lag=0.0), setting._replace(offset=0.0)):
        assert np.abs(innovations_at(replace(affected, setting=other), window, theta)).max() > 1e-3


def test_slopes_of_a_servo_injector_on_a_line_with_waves(case: Case) -> None:
    """What was recorded may be of a lump: slopes are of the model alone."""
    recorded = simulated_event(case, worn_theta(seed=7), event_inputs(rail=0.7), seed=3)
    outflow = "nozzle" if case.c.line.a2_nozzle > 0.0 else "seat"
    on_waves = with_line(load_injector(), model="wave", cells=5, control_displacement=3e-6)
    waves = conftest.make_case(on_waves.model_copy(update={"line_outflow": outflow}))
    window = recorded._replace(start=conftest.start_at_rest(waves.c, 0.7))
    assert_slopes(waves, window, SERVO, by_corners=0.5)  # the needle displaces fuel
