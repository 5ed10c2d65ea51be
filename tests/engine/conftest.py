"""Shared by the tests of the estimation engine: events simulated with the model itself: the truth is known."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import lagged
from observer_rt.core.model.model import advance_state, slopes_of_flows
from observer_rt.engine.estimation import predictor
from observer_rt.engine.estimation.parameters import PARAMETERS, WEIGHTS, Parameter, learned_of
from observer_rt.model.effective import LAG_UNIT, Coefficients, coefficients
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.network import HIDDEN, IS_PAIR, NEURONS, Network, constant_network
from observer_rt.model.parameters import InjectorParameters, LineOutflow
from observer_rt.model.stability import substeps_needed
from tests.intervals import Interval
from tests.model.conftest import at_rest
from tests.plants.arrays import Array

SAMPLE_RATE = 100e3
NOISE = predictor.NoiseLevels(rail_pressure=0.1e6, line_pressure=0.15e6, needle_lift=0.4e-6)
RAIL = 0.95
SMOOTH = np.delete(np.arange(PARAMETERS), Parameter.LIFT_DELAY)  # the lift has corners: its slope is a difference


def changes_of_flows(x: tuple[float, ...], u: tuple[float, ...], network: Network) -> tuple[float, float]:
    """N_H and N_S of (7): relative changes of both flows; u = [p_R A_S], or with the time since opening [s]."""
    c = coefficients(load_injector())
    learned, healthy = (slopes_of_flows(x, u, c, each) for each in (network, constant_network()))
    return learned["q_h"] / healthy["q_h"] - 1.0, learned["q_s"] / healthy["q_s"] - 1.0


@dataclass(frozen=True)
class Case:
    c: Coefficients
    schedule: predictor.GainSchedule
    setting: predictor.Setting

    def tuned_to(self, theta: Array) -> "Case":
        """The same model with the gain for the line and the sensor of theta."""
        learned = learned_of(theta, self.c)
        schedule = predictor.gain_schedule(learned.coefficients, NOISE, SAMPLE_RATE, float(learned.sensor[0]))
        return Case(self.c, schedule, self.setting._replace(gain=schedule.gains[-1].copy()))


@pytest.fixture(scope="session", params=list(LineOutflow), ids=str)
def case(request: pytest.FixtureRequest) -> Case:
    """The nominal injector in both outflow forms."""
    return make_case(load_injector().model_copy(update={"line_outflow": request.param}))


@pytest.fixture(scope="session", params=list(LineOutflow), ids=str)
def affected(request: pytest.FixtureRequest) -> Case:
    """Both forms with effects in force on everything the predictor computes."""
    injector = load_injector().model_copy(update={"line_outflow": request.param})
    model = effective_model(
        injector,
        [
            sized("orifice_area", v_H=0.1),
            sized("guide_leakage", c=1e-14),
            sized("pressure_dependent_bulk_modulus", n=6.0),
            sized("entrained_air", g=2e-3),
            sized("orifice_cavitation", n_crit_excess=0.15),
            sized("chamber_pressure_rise", dp=6e6, s=0.5),
        ],
    )
    c = model.coefficients
    schedule = predictor.gain_schedule(c, NOISE, SAMPLE_RATE, 10e-6, 0.4)
    substeps = substeps_needed(model.injector, SAMPLE_RATE)
    gain = schedule.gains[-1].copy()
    return Case(c, schedule, predictor.Setting(1 / SAMPLE_RATE, substeps, c, gain, late=0.4, lag=10e-6, offset=0.006))


@pytest.fixture(scope="session")
def nominal() -> Case:
    return make_case(load_injector())


def make_case(injector: InjectorParameters) -> Case:
    c = coefficients(injector)
    schedule = predictor.gain_schedule(c, NOISE, SAMPLE_RATE)
    substeps = substeps_needed(injector, SAMPLE_RATE)
    return Case(c, schedule, predictor.Setting(1 / SAMPLE_RATE, substeps, c, schedule.gains[-1].copy()))


def worn_theta(seed: int = 1) -> Array:
    """A parameter vector (PARAMETERS,), no entry 0 but the lift's delay: offset 0.4 MPa, lag 25 us."""
    random = np.random.default_rng(seed)
    theta = np.zeros(PARAMETERS)
    theta[Parameter.NOZZLE_BIAS] = 0.25
    # along two inputs a quarter: the rail's noise in them is left out of the rate's variance, being .01 % of the rate
    theta[WEIGHTS] = random.uniform(0.004, 0.016, HIDDEN) * np.where(np.repeat(IS_PAIR, NEURONS), 0.25, 1.0)
    theta[Parameter.SEAT_BIAS] = -0.15
    theta[Parameter.LINE_PRESSURE_OFFSET] = 0.004
    theta[Parameter.LINE_FRICTION] = 0.8
    theta[Parameter.GUIDE_LEAKAGE] = 0.03
    theta[Parameter.BULK_MODULUS] = -0.07
    theta[Parameter.SENSOR_LAG] = 25e-6 / LAG_UNIT
    theta[Parameter.ENTRAINED_AIR] = 0.02
    theta[Parameter.BACK_PRESSURE : Parameter.BACK_PRESSURE + 2] = 0.03, 0.02
    theta[Parameter.LINE_PRESSURE_GAIN] = -0.012
    return theta


def event_inputs(rail: float = RAIL, samples: int = 600) -> Array:
    """Inputs (samples, 2) at 100 kHz: a stroke from 1 to 2.4 ms."""
    area = np.interp(np.arange(samples) / SAMPLE_RATE, [1.0e-3, 1.3e-3, 2.1e-3, 2.4e-3], [0.0, 0.9, 0.9, 0.0])
    return np.column_stack([np.full(samples, rail), area])


def start_at_rest(c: Coefficients, pressure: float) -> Array:
    """State and indicated pressure with which a window starts behind a shut needle."""
    return np.append(at_rest(c, pressure), pressure)


def recorded_late(window: predictor.Window, samples: float) -> predictor.Window:
    areas = window.inputs[:, 1]
    late = np.interp(np.arange(areas.size) - samples, np.arange(areas.size), areas)
    opening = int(np.argmax(late > 0.0))
    resting = np.arange(window.output.size) < opening
    return window._replace(inputs=np.column_stack((window.inputs[:, 0], late)), opening=opening, resting=resting)


def with_time(inputs: Array, interval: float) -> list[list[float]]:
    opened = np.arange(len(inputs)) - np.argmax(inputs[:, 1] > 0.0) + 1.0
    listed: list[list[float]] = np.column_stack((inputs, np.maximum(opened, 0.0) * interval)).tolist()
    return listed


def simulated_event(case: Case, theta: Array, inputs: Array, seed: int | None = None) -> predictor.Window:
    """Measured signals of an injector that is exactly `theta`; `seed` adds the noise of NOISE."""
    learned = learned_of(theta, case.c)
    c, setting = learned.coefficients, case.setting
    x = settled_line(c, float(inputs[0, 0]))
    start = np.array([*x, x[0]])
    indicated = [x[0]]
    for u_start, u_end in pairwise(with_time(inputs, setting.interval)):
        before = x[0]
        advance_state(x, Interval(u_start, u_end, setting.interval, setting.substeps), c, learned.network, None)
        lag = setting.lag + float(learned.sensor[0])
        indicated.append(lagged(indicated[-1], before, x[0], setting.interval, lag))
    shown = np.array(indicated)
    shown[1:] -= setting.late * np.diff(shown)
    output = (1.0 + float(learned.sensor[1])) * shown + setting.offset + learned.offset
    measured = inputs.copy()
    if seed is not None:
        random = np.random.default_rng(seed)
        output += random.normal(0.0, NOISE.line_pressure / case.c.pressure_scale, output.size)
        measured[:, 0] += random.normal(0.0, NOISE.rail_pressure / case.c.pressure_scale, output.size)
    opened = np.flatnonzero(inputs[:, 1])
    opening = int(opened[0]) if opened.size else output.size
    return predictor.Window(measured, output, np.arange(output.size) < opening, start, opening)


def settled_line(c: Coefficients, rail: float) -> Array:
    """The state behind a shut needle that has rested for long: what leaks flows in, against the friction."""
    pressure = rail
    for _ in range(50):
        pressure = rail - c.line.a4 / c.line.a3 * (c.line.leak / c.line.a1 * pressure) ** 2
    return np.array([pressure, c.line.leak / c.line.a1 * pressure, 0.0])


def innovations_at(case: Case, window: predictor.Window, theta: Array) -> Array:
    result = np.empty(window.output.size)
    predictor.innovations(window, case.setting, learned_of(theta, case.c), result)
    return result
