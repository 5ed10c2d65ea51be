"""`tools/bench networks`: our network, the same with its hidden layer trained, and the paper's, on nine laws.

Trained: after every event centres and widths of the neurons move, too, by a Gauss-Newton step beside W. The paper's:
five neurons of all inputs, Algorithm 1 on each event; it does not say which masses are valid.
"""

import time
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.bench import BenchInjector
from observer_rt.core.model.model import REACH
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.paper import scheme, training
from observer_rt.desk.paper.study import LARGEST_GAIN
from observer_rt.engine.estimation import scalars
from observer_rt.engine.estimation.predictor import Window, innovations
from observer_rt.engine.learning.adequacy import BURN_IN
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.learning.posterior.reader import setting_of
from observer_rt.engine.stream.state import Constants
from observer_rt.model.network import BASIS, GROUPS, HIDDEN, Group, network_with
from tests.observed_plants import bench_at, recording_of
from tests.plants.arrays import Array
from tests.plants.laws import NINE_LAWS
from tests.plants.parameters import Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record
from tests.plants.windows import LEAD, TAIL, true_masses
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, How, Row, conclude, run_cases, table
from tools.benchmarks.cases import Case
from tools.benchmarks.scoring import FROM, WRONG_MASS, score_evaluation

RAIL_PRESSURES, DURATIONS = (60e6, 100e6, 140e6, 80e6, 120e6), (1.4e-3, 0.9e-3, 1.9e-3)  # Pa, s
EVENTS = 24
LAYER_PRIOR = 0.3  # one sigma of a centre, in distances between them, and of the logarithm of a width
STEP, LONGEST_STEP = 0.05, 0.3  # of finite differences, and of one event
COLUMNS: dict[str, tuple[str, How]] = {
    "valid": ("valid_share", "mean"),
    "wrong": ("wrong_valid", "sum"),
    "inside": ("held", "mean"),
    "mean error %": ("error_pct", "mean"),
    "largest %": ("error_pct", "max"),
    "ms an event": ("ms", "median"),  # of the processor, all of the observer
}
BARS = (
    Bar("wrong_while_valid", "wrong_valid", "sum", most=0, of="network == 'fixed'"),
    Bar("valid_share", "valid_share", "mean", least=0.83, of="network == 'fixed'", by="law"),
    Bar("inside_share", "held", "mean", least=0.93, of="network == 'fixed'"),
)


class TrainedLayer(Learner):
    """Ours with centres and widths of the neurons learned beside W."""

    def __init__(self, constants: Constants, start: Knowledge) -> None:
        super().__init__(constants, start)
        self._layer, self._information = np.zeros(2 * HIDDEN), np.eye(2 * HIDDEN) / LAYER_PRIOR**2

    def learn(self, window: Window, *others: Any) -> Outcome:
        """Learn W, then move the hidden layer with W held, by what all events so far say of it."""
        outcome = super().learn(window, *others)
        if outcome.adoption is Adoption.ADOPTED:
            self._train(window, outcome)
        return outcome

    def _train(self, window: Window, outcome: Outcome) -> None:
        setting, theta = setting_of(self._constants, outcome.schedule), outcome.estimate
        learned = scalars.learned_of(theta, setting.coefficients)

        def residuals(layer: Array) -> Array:
            set_layer(layer)
            curves, errors = network_with(theta[scalars.WEIGHTS]).curves, np.empty(window.output.size)
            network = learned.network._replace(curves=curves)
            innovations(window, setting, learned._replace(network=network), errors)
            return np.asarray(errors[round(BURN_IN / setting.interval) :] / outcome.schedule.innovation_sigma)

        here = residuals(self._layer)
        moved = np.array([residuals(self._layer + step) for step in STEP * np.eye(2 * HIDDEN)])
        slopes = (moved - here) / STEP
        if np.isfinite(slopes).all():
            self._information += slopes @ slopes.T
            step = np.linalg.solve(self._information, slopes @ here)
            self._layer -= step * LONGEST_STEP / max(float(np.abs(step).max()), LONGEST_STEP)
        set_layer(self._layer)


class PapersNetwork(Learner):
    """The paper's network beside ours, which cuts out its events. masses: [kg], by what those before have taught."""

    def __init__(self, constants: Constants, start: Knowledge) -> None:
        super().__init__(constants, start)
        gain, c = min(LARGEST_GAIN, 1.0 / constants.interval), constants.coefficients
        self._setting = scheme.PaperSetting(constants.interval, constants.substeps, c, gain)
        self._weights, self._start = scheme.no_fault(), scheme.scaled_identity(training.BETA)
        self.masses: list[float] = []

    def learn(self, window: Window, *others: Any) -> Outcome:
        """Observe the event, then train on it."""
        setting, opened = self._setting, np.flatnonzero(window.inputs[:, 1] > 0.0)
        rate = scheme.swept(window, setting, scheme.free_network(self._weights, setting.gain)).rate
        lead, tail = (round(each / setting.interval) for each in (LEAD, TAIL))
        volume = float(np.trapezoid(rate[max(opened[0] - lead, 0) : opened[-1] + tail])) * setting.interval
        self.masses.append(Injector().density * volume)
        self._weights = self._start = training.train(window, setting, self._weights, self._start)
        return super().learn(window, *others)


NETWORKS = {"fixed": Learner, "trained": TrainedLayer, "paper's": PapersNetwork}


def set_layer(layer: Array) -> None:
    """Move the neurons of this process: centres (HIDDEN,), in distances between them, and logarithms of widths."""
    moves = iter(zip(*np.split(layer, 2), strict=True))
    for curve, group in enumerate(GROUPS):
        centres, distance = np.linspace(group.first, group.last, group.neurons, retstep=True)
        for neuron, centre in enumerate(centres):
            shift, width = next(moves)
            first = centre + shift * distance
            pair = Group(2, first, first + distance * np.exp(width))
            BASIS[curve, :, :, neuron] = pair.basis(REACH[curve])[:, :, 0]
    for function in vars(scalars).values():  # what theta means is another thing now
        if hasattr(function, "cache_clear"):
            function.cache_clear()


def score_law(law: str, network: str, seed: int) -> Row:
    """An injector with a law: valid, wrong and held masses from the fifth event on."""
    laws, faults = NINE_LAWS[law]
    shots = [(RAIL_PRESSURES[k % 5], Shot(7e-6 * (k % 5), DURATIONS[k % 3])) for k in range(EVENTS)]
    events = tuple(Event(pressure, (shot,), faults) for pressure, shot in shots)
    case = Case(law, seed, 0, Bench(Injector(), Needle(), events, seed=seed, laws=laws))
    outcome, bench, made = record(case.bench), bench_at(case.bench.sample_rate), list[Learner]()

    def learner(_: BenchInjector, constants: Constants, start: Knowledge) -> Learner:
        made.append(NETWORKS[network](constants, start))
        return made[-1]

    set_layer(np.zeros(2 * HIDDEN))  # a process has several cases
    begin = time.process_time()
    evaluation = evaluate(bench, [recording_of(outcome)], learner_of=learner).evaluations[0]
    row: Row = {"law": law, "network": network, "ms": 1e3 * (time.process_time() - begin) / EVENTS}
    if isinstance(made[0], PapersNetwork):
        errors = 100.0 * np.abs(np.array(made[0].masses) / true_masses(outcome, case.bench) - 1.0)[FROM:]
        return row | {"error_pct": errors.tolist(), "wrong_valid": int(np.sum(errors > WRONG_MASS))}
    facts = score_evaluation(case, outcome, bench, evaluation).facts()
    return facts | row | {"error_pct": np.abs(facts["observer_errors_pct"]).tolist()}


@cli.app.command(epilog="Example: tools/bench networks --cases 2")
def networks(
    cases: cli.CasesOption = 1, seed: cli.SeedOption = 1, jobs: cli.JobsOption = cli.JOBS, out: cli.OutOption = None
) -> None:
    """Networks with a fixed hidden layer, a trained one, and the paper's, on nine laws that no model has."""
    todo = [(law, name, seed + number) for name in NETWORKS for law in NINE_LAWS for number in range(cases)]
    out = out or Path("build/networks")
    frame = run_cases("networks", score_law, {" ".join(map(str, each)): each for each in todo}, jobs, out)
    tables = {name: table(frame[frame["network"].eq(name)], "law", COLUMNS) for name in NETWORKS}
    conclude(frame, BARS, tables, out)
