"""`tools/bench networks`: our network on injectors with a law and without, and others beside it.

Nine laws of one input each and ten of two inputs, which no model has; injectors that wear evenly. Without: the same
observer whose weights are held at 0. The paper's: five neurons of all inputs, Algorithm 1 on each event; it does not
say which masses are valid. The filter: of seven states, two of them changes of the flows, and no law.
"""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from observer_rt.config.bench import BenchInjector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.paper import scheme
from observer_rt.desk.paper.study import LARGEST_GAIN
from observer_rt.engine.estimation.parameters import WEIGHTS
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.knowledge import Knowledge, Outcome
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.stream.state import Constants
from tests.observed_plants import bench_at, recording_of
from tests.plants.laws import NINE_LAWS, NO_LAWS, TEN_PRODUCTS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record
from tests.plants.windows import LEAD, MILLIGRAM, TAIL, true_masses, windows_of
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, How, Row, conclude, frame_of, run_cases, summed_up, table, values_of
from tools.benchmarks.cases import Case
from tools.benchmarks.scoring import FROM, WRONG_MASS, estimate_of, score_evaluation
from tools.benchmarks.unscented import unscented_rate

RAIL_PRESSURES, DURATIONS = (60e6, 100e6, 140e6, 80e6, 120e6), (1.4e-3, 0.9e-3, 1.9e-3)  # Pa, s
EVENTS = 24
PLANTS, PRESSURES = 14, 3  # that wear evenly, each at as many rail pressures of its own
LEARNED, LEARNED_FROM = 2.0, 12  # standard deviations of a mass that its prediction may be off; injections before
NARROW = 1e-4  # of their prior, that weights held at 0 may be
NO_LAW, OURS, WITHOUT, PAPERS, FILTER = "no law", "ours", "without", "paper's", "filter"
HOWS: dict[str, How] = {"rms": lambda v: float(np.sqrt(np.mean(np.square(list(v))))), "p95": "p95", "largest": "max"}
COLUMNS: dict[str, tuple[str, How]] = {
    "valid": ("valid_share", "mean"),
    "wrong": ("wrong_valid", "sum"),
    "inside": ("held", "mean"),
    "1.96 sigma %": ("half_width_pct", "mean"),
    "mean error %": ("error_pct", "mean"),
    "rms %": ("error_pct", HOWS["rms"]),
    "p95 %": ("error_pct", "p95"),
    "largest %": ("error_pct", "max"),
    "predicted p95 %": ("predicted_pct", "p95"),
    "learned": ("learned", "mean"),  # share of late injections with no remainder
    "ms an event": ("ms", "median"),  # of the processor, all of the observer
}
_OURS_ONE, _OURS_TWO = "network == 'ours' and inputs == 1", "network == 'ours' and inputs == 2"
BARS = (
    Bar("wrong_while_valid", "wrong_valid", "sum", most=0, of="network == 'ours'"),
    Bar("valid_share", "valid_share", "mean", least=0.83, of=_OURS_ONE, by="law"),
    Bar("inside_share", "held", "mean", least=0.93, of=_OURS_ONE),
    Bar("valid_share_two_inputs", "valid_share", "mean", least=0.85, of=_OURS_TWO, by="law"),
    Bar("learned_share_two_inputs", "learned", "mean", least=0.85, of=_OURS_TWO),
    *(Bar(f"no_law_{how}_over_{WITHOUT}", f"{how}_{WITHOUT}", "mean", most=1.1) for how in (*HOWS, "half_width")),
    *(Bar(f"no_law_{how}_over_{FILTER}", f"{how}_{FILTER}", "mean", most=1.1) for how in HOWS),
)


class LawlessLearner(Learner):
    """Ours, with the weights of its network held at 0."""

    def __init__(self, constants: Constants, start: Knowledge) -> None:
        state = start.state.map(lambda each: replace(each, belief=each.belief.narrowed(WEIGHTS.tolist(), NARROW)))
        super().__init__(constants, replace(start, state=state))


class PapersNetwork(Learner):
    """The paper's network beside ours, which cuts out its events. masses: [kg], by what those before have taught."""

    def __init__(self, constants: Constants, start: Knowledge) -> None:
        super().__init__(constants, start)
        gain, c = min(LARGEST_GAIN, 1.0 / constants.interval), constants.coefficients
        self._setting = scheme.PaperSetting(constants.interval, constants.substeps, c, gain)
        self._weights, self._start = scheme.no_fault(), scheme.scaled_identity(scheme.BETA)
        self.masses: list[float] = []

    def learn(self, window: Window, *others: Any) -> Outcome:
        """Observe the event, then train on it."""
        setting, opened = self._setting, np.flatnonzero(window.inputs[:, 1] > 0.0)
        rate = scheme.swept(window, setting, scheme.free_network(self._weights, setting.gain)).rate
        lead, tail = (round(each / setting.interval) for each in (LEAD, TAIL))
        volume = float(np.trapezoid(rate[max(opened[0] - lead, 0) : opened[-1] + tail])) * setting.interval
        self.masses.append(Injector().density * volume)
        self._weights = self._start = scheme.train(window, setting, self._weights, self._start)
        return super().learn(window, *others)


LEARNERS = {OURS: Learner, WITHOUT: LawlessLearner, PAPERS: PapersNetwork}
ALL_LAWS: dict[str, tuple[Laws, Faults]] = NINE_LAWS | TEN_PRODUCTS


def plant_of(law: str, seed: int) -> Bench:
    """A plant with a law; with none: worn evenly, with three rail pressures of its own."""
    laws, faults, pressures = *ALL_LAWS.get(law, (NO_LAWS, Faults())), RAIL_PRESSURES
    if law == NO_LAW:
        random = np.random.default_rng(seed)
        nozzle, seat, is_seat_worn = *random.uniform(-0.3, 0.4, 2), random.random() < 0.5
        faults = Faults(orifice_area=nozzle, seat_area=seat * is_seat_worn)
        pressures = tuple(random.uniform(40e6, 160e6, PRESSURES).tolist())
    durations = [DURATIONS[(k + k // len(pressures)) % len(DURATIONS)] for k in range(EVENTS)]
    shots = [(pressures[k % len(pressures)], Shot(7e-6 * (k % 5), durations[k])) for k in range(EVENTS)]
    schedule = tuple(Event(pressure, (shot,), faults) for pressure, shot in shots)
    return Bench(Injector(), Needle(), schedule, seed=seed, laws=laws)


def score_law(law: str, network: str, seed: int) -> Row:
    """An injector with a law, or none: valid, wrong and held masses from the fifth event on."""
    case = Case(law, seed, 0, plant_of(law, seed))
    outcome, bench, made = record(case.bench), bench_at(case.bench.sample_rate), list[Learner]()
    row: Row = {"law": law, "network": network, "inputs": 1 + (law in TEN_PRODUCTS) - (law == NO_LAW)}
    if network == FILTER:
        windows, true = windows_of(outcome, case.bench.sample_rate), true_masses(outcome, case.bench) / MILLIGRAM
        masses = estimate_of(unscented_rate(outcome.measured), outcome, windows, Injector().density).masses
        return row | {"error_pct": (100.0 * np.abs(masses / true - 1.0)[FROM:]).tolist()}

    def learner(_: BenchInjector, constants: Constants, start: Knowledge) -> Learner:
        made.append(LEARNERS[network](constants, start))
        return made[-1]

    begin = time.process_time()
    evaluation = evaluate(bench, [recording_of(outcome)], learner_of=learner).evaluations[0]
    row |= {"ms": 1e3 * (time.process_time() - begin) / len(case.bench.events)}
    if isinstance(made[0], PapersNetwork):
        errors = 100.0 * np.abs(np.array(made[0].masses) / true_masses(outcome, case.bench) - 1.0)[FROM:]
        return row | {"error_pct": errors.tolist(), "wrong_valid": int(np.sum(errors > WRONG_MASS))}
    facts = score_evaluation(case, outcome, bench, evaluation).facts()
    reports, true = evaluation.reports, true_masses(outcome, case.bench)
    predicted = 100.0 * np.abs(np.array([report.predicted_mass for report in reports]) / true - 1.0)[FROM:]
    learned = [abs(report.remainder) <= LEARNED * report.relative_sigma for report in reports[LEARNED_FROM:]]
    row |= {"predicted_pct": predicted.tolist(), "learned": float(np.mean(learned))}
    return facts | row | {"error_pct": np.abs(facts["observer_errors_pct"]).tolist()}


def ratios(frame: pd.DataFrame) -> Row:
    """Errors and half widths of our masses where there is no law, over those of the others."""
    row: Row = {"label": "ratios"}
    errors = {name: values_of(frame[frame["network"].eq(name)], "error_pct") for name in (OURS, WITHOUT, FILTER)}
    for name in (WITHOUT, FILTER):
        row |= {f"{by}_{name}": summed_up(errors[OURS], of) / summed_up(errors[name], of) for by, of in HOWS.items()}
    widths = [values_of(frame[frame["network"].eq(name)], "half_width_pct").mean() for name in (OURS, WITHOUT)]
    return row | {f"half_width_{WITHOUT}": widths[0] / widths[1]}


@cli.app.command(epilog="Example: tools/bench networks --cases 2")
def networks(
    cases: cli.CasesOption = 1, seed: cli.SeedOption = 1, jobs: cli.JobsOption = cli.JOBS, out: cli.OutOption = None
) -> None:
    """Our network on laws of one and of two inputs and on even wear; beside it the paper's, a filter, none."""
    seeds = range(seed, seed + cases)
    todo = [(law, name, each) for name in (OURS, PAPERS) for law in ALL_LAWS for each in seeds]
    todo += [(NO_LAW, name, seed + n) for name in (OURS, WITHOUT, FILTER) for n in range(PLANTS * cases)]
    out = out or Path("build/networks")
    frame = run_cases("networks", score_law, {" ".join(map(str, each)): each for each in todo}, jobs, out)
    of_laws, of_none = frame[frame["law"].ne(NO_LAW)], frame[frame["law"].eq(NO_LAW)]
    tables = {name: table(of_laws[of_laws["network"].eq(name)], "law", COLUMNS) for name in (OURS, PAPERS)}
    tables |= {NO_LAW: table(of_none, "network", COLUMNS)}
    conclude(pd.concat([frame, frame_of([ratios(of_none)])]), BARS, tables, out)
