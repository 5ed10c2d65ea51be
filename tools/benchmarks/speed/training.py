"""The paper's training, 30 epochs over the samples of an event, against scipy's BFGS on the same cost and gradient.

Both are given the same compiled cost; scipy's search is Python round it, ours is compiled with it.

That is `training = "paper"`. The default training is another problem, Gauss-Newton on the prediction error, for which
scipy has no peer; what an event of it takes stands beside.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import minimize

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import normalised_area
from observer_rt.core.model.model import fault_with_rate
from observer_rt.core.paper.scheme import FaultCost
from observer_rt.desk.simulation.schedule import Event, Schedule, Shot
from observer_rt.desk.simulation.simulate import simulate
from observer_rt.engine.paper_scheme.network import WEIGHTS, fault_cost, scaled_identity
from observer_rt.engine.paper_scheme.training import BETA, EPOCHS, GAMMA, Objective, minimise
from observer_rt.engine.service.core import Core
from observer_rt.foundation.units import MILLISECOND
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import sized
from observer_rt.model.network import constant_network
from tests.observed_plants import bench_at
from tests.plants.arrays import Array
from tools.benchmarks.scoring import timed_training
from tools.benchmarks.speed.sample import thread_seconds
from tools.benchmarks.speed.traffic import INPUT_ID, SAMPLE_RATE, Traffic, payloads_of

SAMPLES = (250, 500, 1000, 2000, 4000)
USUAL = 500
REPEATS = 15
GAIN = 1e5  # 1/s, unit of the network's outputs
WEAR = 0.3
_FINE = 1e6  # Hz


@dataclass(frozen=True)
class TrainingTimes:
    """Milliseconds of the fastest training each, by samples; ratio: median over turns at 500.

    exponent: of the samples, by which ours grows from 500 on; costs: J that each came to, over that of the start;
    evaluations: of J alone and of J with its gradient, that each needed at 500.
    """

    ours: dict[int, float]
    scipy: dict[int, float]
    ratio: float
    exponent: float
    costs: tuple[float, float]
    evaluations: tuple[tuple[int, int], tuple[int, int]]
    default_ms: float


def measure_training(traffic: Traffic, repeats: int = REPEATS) -> TrainingTimes:
    """Both in turn on the same samples of one injection of a worn nozzle, taken more and more densely."""
    ours, theirs, ratio, costs = {}, {}, float("nan"), (float("nan"), float("nan"))
    for samples in SAMPLES:
        cost = cost_of(samples)
        trainings = partial(_ours, cost), partial(_scipy, cost)
        turns = np.array([[thread_seconds(each) for each in trainings] for _ in range(repeats)])
        ours[samples], theirs[samples] = (turns.min(axis=0) / MILLISECOND).tolist()
        if samples == USUAL:
            ratio = float(np.median(turns[:, 1] / turns[:, 0]))
            start = cost.value(scaled_identity(BETA))
            costs = _ours(cost) / start, _scipy(cost) / start
    many = [n for n in SAMPLES if n >= USUAL]
    exponent = float(np.polyfit(np.log(many), np.log([ours[n] for n in many]), 1)[0])
    evaluations = _evaluations(_ours), _evaluations(_scipy)
    return TrainingTimes(ours, theirs, ratio, exponent, costs, evaluations, _default_training_ms(traffic))


def cost_of(samples: int) -> FaultCost:
    """The cost (10) of so many samples of an injection whose phi is known."""
    return fault_cost(*_training_data(samples), GAIN)


def _training_data(samples: int) -> tuple[Array, Array]:
    injector = load_injector()
    schedule = Schedule((Event(1e-3, 100e6, (Shot(1.9e-3),)),), 5e-3)
    truth = simulate(injector, schedule, _FINE, (sized("orifice_area", v_H=WEAR),)).truth
    c = coefficients(injector)
    opened = np.flatnonzero(truth.needle_lift > 0.0)
    chosen = np.linspace(opened[0], opened[-1], samples).astype(int)
    line, sac, rail = (
        (pressure[chosen] - c.chamber_pressure) / c.pressure_scale
        for pressure in (truth.line_pressure, truth.sac_pressure, truth.rail_pressure)
    )
    flow = truth.line_flow[chosen] / c.flow_scale
    area = np.array([normalised_area(lift, c.seat) for lift in truth.needle_lift[chosen]])
    z = np.column_stack([line, flow, sac, rail, area, np.ones(samples)])
    worn = constant_network(nozzle=WEAR)
    target = np.array([fault_with_rate(tuple(x[:3]), (x[3], x[4]), c, worn)[0] for x in z])
    return z, target


class _CountingCost:
    """Counts how often a cost is asked for."""

    def __init__(self, cost: FaultCost) -> None:
        self._cost = cost
        self.values = 0
        self.gradients = 0

    def value(self, theta: Array) -> float:
        """J."""
        self.values += 1
        return self._cost.value(theta)

    def gradient(self, theta: Array) -> Array:
        """Its gradient."""
        self.gradients += 1
        return self._cost.gradient(theta)


def _evaluations(train: Callable[[Objective], float]) -> tuple[int, int]:
    cost = _CountingCost(cost_of(USUAL))
    train(cost)
    return cost.values, cost.gradients


def _ours(cost: Objective) -> float:
    start = scaled_identity(BETA)
    return minimise(cost, start, np.eye(WEIGHTS) / GAMMA, tolerance=0.0, max_iterations=EPOCHS).value


def _scipy(cost: Objective) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a line search that ends early
        found = minimize(
            lambda theta: (cost.value(theta), cost.gradient(theta)),
            scaled_identity(BETA),
            jac=True,
            method="BFGS",
            options={"maxiter": EPOCHS, "gtol": 0.0},
        )
    return float(found.fun)


def _default_training_ms(traffic: Traffic) -> float:
    """Milliseconds of an event, the median."""
    bench = bench_at(SAMPLE_RATE)
    core = Core(bench.injector, map_bus(bench))
    with timed_training() as milliseconds:
        for number, payload in enumerate(payloads_of(traffic)):
            core.handle(INPUT_ID, False, payload, number)
        core.finish()
    return float(np.median(milliseconds))
