"""Our observer, and the nominal model beside it, on one case: facts of its injections against the truth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, exact_text, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.simulation.schedule import Schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS, Z_95
from observer_rt.model.effects import sized
from tests.observed_plants import recording_of
from tests.plants.arrays import Array
from tests.plants.plant import Outcome
from tests.plants.windows import Windows, true_masses, windows_of
from tools.benchmarks.campaign import How, tally
from tools.benchmarks.cases import CLASSES, Case
from tools.benchmarks.windowed import evaluate_windowed

FROM = 4  # event, from 0: everything but the figures of the first events counts from the fifth on
THIRD_EVENT, USEFUL_PCT = 2, 1.0  # whose mass is the first that must be useful
RECOVERY_EVENTS = 3  # after a change
WORSE_EVENTS = 3  # more of which must not be worse than the nominal model
COVERAGE_EVENT = 14  # one injection a case
WAVE_JUDGED = 2  # events after which a travelling wave must be known as such
WRONG_MASS, WRONG_RATE = 3.0, 3.0  # %, mm3/ms, beyond which a valid injection is wrong
# Classes in which the third event's mass is asked for.
WORN_FROM_THE_START = ("orifice_area", "seat_area", "orifice_and_seat_area", "growing_wear", "missing_injections")
OBSERVER, LIVE, NOMINAL = "observer", "live", "nominal"  # as published, while it ran, with phi = 0
PRESSURE_SCALE = 100 * MEGAPASCAL  # of x3
NO_REPORT = "NO_REPORT"  # in the place of a reason
COLUMNS: dict[str, tuple[str, How]] = {  # that tables of facts share
    "cases": ("label", "count"),
    "valid": ("valid_share", "mean"),
    "mass error %, single valid: median / p95 / max": (f"{OBSERVER}_errors_pct", "spread"),
    "RMSE mm3/ms": (f"{OBSERVER}_rmse", "spread"),
    "inside": ("held", "of"),
    "1.96 sigma %": ("half_width_pct", "median"),
    "wrong": ("wrong_valid", "sum"),
    "refused": ("refused", tally),
}


@dataclass(frozen=True, eq=False)
class Estimate:
    """What an estimator made of a recording: masses of the openings [mg], mean squares by event of its errors.

    rate_squares [(mm3/ms)^2]; x3_squares: of the normalised sac pressure, nan for an estimator without one.
    """

    masses: Array
    rate_squares: Array
    x3_squares: Array


@dataclass(frozen=True)
class Injection:
    """What the observer reports as one injection: an opening, or several that it cannot tell apart."""

    event: int
    openings: tuple[int, ...]
    valid: bool
    report: InjectionReport | None = None


@dataclass(frozen=True, eq=False)
class Score:
    """One case scored against the truth; sequences without another word are by event."""

    case: Case
    of_event: tuple[tuple[int, ...], ...]
    true_masses: Array  # of the openings [mg]
    window_samples: Array
    injections: tuple[Injection, ...]
    valid: tuple[bool, ...]
    reasons: tuple[str, ...]
    mass_ci95_mg: tuple[tuple[float, float] | None, ...]
    rate_judged: NDArray[np.int64]  # samples with an open needle and a standard deviation of the rate
    rate_covered: NDArray[np.int64]  # of these, samples whose 95 % interval holds the true rate
    estimates: dict[str, Estimate] = field(default_factory=dict)
    count_from: int = FROM  # event, of which errors are stated first

    @property
    def scored(self) -> list[Injection]:
        """The valid injections whose errors are stated."""
        return [each for each in self.injections if each.valid and each.event >= self.count_from]

    def event_masses(self, masses: Array) -> Array:
        return np.array([sum(masses[i] for i in openings) for openings in self.of_event])

    def event_errors_pct(self, name: str = OBSERVER) -> Array:
        """Signed mass error of every event."""
        true = self.event_masses(self.true_masses)
        return np.asarray(100.0 * (self.event_masses(self.estimates[name].masses) / true - 1.0), np.float64)

    def errors_pct(self, injections: Sequence[Injection], name: str = OBSERVER) -> Array:
        """Signed mass error of single injections."""
        estimated, true = (
            np.array([sum(masses[i] for i in each.openings) for each in injections], np.float64)
            for masses in (self.estimates[name].masses, self.true_masses)
        )
        return np.asarray(100.0 * (estimated / true - 1.0), np.float64)

    def mean(self, squares: Array) -> float:
        """Over the samples of all windows of those events."""
        return float(np.average(squares[self.count_from :], weights=self.window_samples[self.count_from :]))

    @property
    def _intervals(self) -> list[tuple[float, float, float]]:
        """Of the valid ones of those events: bounds and true mass [mg]."""
        masses = self.event_masses(self.true_masses)
        rows = list(zip(self.valid, self.mass_ci95_mg, masses, strict=True))[self.count_from :]
        return [(*interval, mass) for valid, interval, mass in rows if valid and interval]

    def covered(self, event: int) -> bool | None:
        """Whether the 95 % interval of an event's mass holds the true mass; None without interval."""
        interval = self.mass_ci95_mg[event]
        true = sum(self.true_masses[i] for i in self.of_event[event])
        return None if interval is None else bool(interval[0] <= true <= interval[1])

    def facts(self, wrong_rate: float = WRONG_RATE) -> dict[str, Any]:
        """The case as a row: errors in %, rates in mm3/ms, shares from 0 to 1; None or no list: not asked.

        wrong_rate: beyond it a valid injection is wrong [mm3/ms].
        """
        case, errors = self.case, self.event_errors_pct()
        group = CLASSES[case.class_name].group if case.class_name in CLASSES else None
        ours, theirs = self.estimates[OBSERVER], self.estimates[NOMINAL]
        valid = [each for each in self.injections if each.valid]
        rough = np.array([ours.rate_squares[each.event] > wrong_rate**2 for each in valid], np.bool_)
        wrong = (np.abs(self.errors_pct(valid)) > WRONG_MASS) | rough
        excess = np.abs(errors) - np.abs(self.event_errors_pct(NOMINAL))
        x3, judged = self.mean(ours.x3_squares), int(self.rate_judged[self.count_from :].sum())
        wear = case.bench.events[-1].faults.orifice_area
        summed = [i for each in self.scored for i in each.openings]
        in_time = None
        if case.change_event is not None:
            in_time = bool(abs(errors[case.change_event + RECOVERY_EVENTS]) < USEFUL_PCT)
        elif case.class_name in WORN_FROM_THE_START:
            in_time = bool(abs(errors[THIRD_EVENT]) < USEFUL_PCT)
        facts: dict[str, Any] = {
            "class_name": case.class_name,
            "group": group,
            "changes": case.change_event is not None,
            "nozzle_wear": wear,
            "valid_share": float(np.mean(self.valid[self.count_from :])),
            "wrong_valid": int(wrong.sum()),
            "valid_late": sum(self.valid[WAVE_JUDGED:]),
            "in_time": in_time,
            # how much worse than the nominal model more than three events are, at the least
            "excess_pct": float(np.sort(np.nan_to_num(excess, nan=np.inf))[-1 - WORSE_EVENTS]),
            "excesses_pct": (
                np.abs(self.errors_pct(self.scored)) - np.abs(self.errors_pct(self.scored, NOMINAL))
            ).tolist(),
            "x3_ratio": self.mean(theirs.x3_squares) / x3 if x3 > 0.0 else math.inf,
            "covered": self.covered(COVERAGE_EVENT),
            "held": [bool(low <= mass <= high) for low, high, mass in self._intervals],
            "half_width_pct": [50.0 * (high - low) / mass for low, high, mass in self._intervals],
            "rate_coverage": float(self.rate_covered[self.count_from :].sum() / judged) if judged else None,
            "refused": [reason for reason in self.reasons[self.count_from :] if reason],
            "nearer_to_nominal": self._fallbacks(),
            "outside_own_interval": self._outside(),
        }
        if summed:  # errors cancel
            mass, true = (sum(masses[i] for i in summed) for masses in (ours.masses, self.true_masses))
            facts["sum_error_pct"] = float(100.0 * (mass / true - 1.0))
        for name, estimate in self.estimates.items():
            facts[f"{name}_errors_pct"] = self.errors_pct(self.scored, name).tolist()
            facts[f"{name}_rmse"] = math.sqrt(self.mean(estimate.rate_squares))
        return facts

    def _fallbacks(self) -> int:
        """Of those events, those whose mass is nearer to the nominal model's than to the truth."""
        observer, nominal, true = (
            self.event_masses(masses)[self.count_from :]
            for masses in (self.estimates[OBSERVER].masses, self.estimates[NOMINAL].masses, self.true_masses)
        )
        matters = np.abs(nominal - true) > 0.02 * true
        return int(np.sum(matters & (np.abs(observer - nominal) < np.abs(observer - true))))

    def _outside(self) -> int:
        """Events whose published mass lies outside its own interval."""
        masses = self.event_masses(self.estimates[OBSERVER].masses)
        return sum(
            interval is not None and not interval[0] - 1e-6 <= mass <= interval[1] + 1e-6
            for mass, interval in zip(masses, self.mass_ci95_mg, strict=True)
        )


def score_outcome(case: Case, outcome: Outcome, bench: Bench) -> Score:
    """Score an observer by its bench, and the nominal model beside it, on what a case came to."""
    recording = recording_of(outcome)
    if case.class_name in CLASSES and CLASSES[case.class_name].windowed:
        return score_evaluation(case, outcome, bench, evaluate_windowed(bench, recording))
    return score_evaluation(case, outcome, bench, evaluate(bench, [recording]).evaluations[0])


def score_evaluation(case: Case, outcome: Outcome, bench: Bench, evaluation: Evaluation) -> Score:
    """Score what an observer by its bench made of a case."""
    windows = windows_of(outcome, case.bench.sample_rate)
    truth, trace, density = outcome.truth, evaluation.trace, case.bench.injector.density
    rate = np.where(np.isnan(trace.injection_rate), trace.nominal_rate, trace.injection_rate)
    nominal_x3 = x3_of_rate(trace.nominal_rate, bench)
    x3 = np.where(np.isnan(trace.x[:, 2]), nominal_x3, trace.x[:, 2])
    true_x3 = (truth.sac_pressure - case.bench.injector.chamber_pressure) / PRESSURE_SCALE
    corrected = np.where(np.isnan(trace.corrected_rate), rate, trace.corrected_rate)
    injections, live, ours = (
        injections_of(evaluation, windows),
        *(estimate_of(each, outcome, windows, density, x3 - true_x3) for each in (rate, corrected)),
    )
    said = _judged(injections, len(windows.of_event))
    covered = _covered_samples(corrected - truth.injection_rate, trace.corrected_rate_sigma, windows)
    estimates = {
        OBSERVER: replace(ours, masses=_published_masses(live.masses, injections)),
        LIVE: live,
        NOMINAL: estimate_of(trace.nominal_rate, outcome, windows, density, nominal_x3 - true_x3),
    }
    masses = true_masses(outcome, case.bench) / MILLIGRAM
    samples = np.array([windows.union(event).size for event in range(len(windows.of_event))])
    return Score(case, windows.of_event, masses, samples, injections, *said, *covered, estimates)


def _published_masses(live: Array, injections: Sequence[Injection]) -> Array:
    """Masses of the openings [mg], together those that are reported; live: in proportion to which they share them."""
    masses = live.copy()
    for injection in injections:
        if injection.report is not None and math.isfinite(injection.report.mass):
            openings = [*injection.openings]
            masses[openings] *= injection.report.mass / MILLIGRAM / live[openings].sum()
    return masses


def estimate_of(rate: Array, outcome: Outcome, windows: Windows, density: float, x3: Array | None = None) -> Estimate:
    """Of an estimator's rate [m3/s] at every sample, and of its normalised sac pressure if it has one."""
    off = (rate - outcome.truth.injection_rate) / MM3_PER_MS
    squares = np.array(windows.mean_squares(np.full(rate.size, np.nan) if x3 is None else x3))
    return Estimate(windows.masses(rate, density) / MILLIGRAM, np.array(windows.mean_squares(off)), squares)


def bench_text(*changes: tuple[str, str]) -> str:
    """The example bench file with texts in the place of others."""
    text = exact_text(EXAMPLE_BENCH)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def worn_injector(schedule: Schedule, sample_rate: float, wear: float = 0.2, seed: int = 1) -> Simulation:
    """What an injector with a worn nozzle [v_H] does, of the package's own simulation, with usual noise."""
    worn = (sized("orifice_area", v_H=wear),) if wear else ()
    return simulate(load_injector(), schedule, sample_rate, worn, SimulatedNoise(), seed=seed)


def x3_of_rate(rate: Array, bench: Bench) -> Array:
    """x3 at which the nominal nozzle passes a rate [m3/s]: (23) solved for p_S."""
    part = bench.injector.parameters
    jet = math.sqrt(2.0 * PRESSURE_SCALE / part.fluid.density_nozzle)
    root: Array = rate / (part.nozzle.flow_coefficient * part.nozzle.area * jet)
    return root * np.abs(root)


def _covered_samples(error: Array, sigma: Array, windows: Windows) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Samples with an open needle and a sigma (n,) that is not nan, and those within 1.96 of it, event by event."""
    available = np.isfinite(sigma)
    covered = available & (np.abs(error) <= Z_95 * np.where(available, sigma, 0.0))
    available_of, covered_of = (
        np.array([sum(int(np.sum(marked[windows.opened[i]])) for i in openings) for openings in windows.of_event])
        for marked in (available, covered)
    )
    return available_of, covered_of


def injections_of(evaluation: Evaluation, windows: Windows) -> tuple[Injection, ...]:
    """The openings of every event by the report that covers them; one without a report stands alone, not valid."""
    injections = []
    for event, openings in enumerate(windows.of_event):
        reports = {i: _report_of(evaluation, windows.ranges[i]) for i in openings}
        numbers = {i: -i - 1 if report is None else report.number for i, report in reports.items()}
        for number in dict.fromkeys(numbers.values()):
            together = tuple(i for i in openings if numbers[i] == number)
            report = reports[together[0]]
            rates = [evaluation.trace.injection_rate[windows.ranges[i]] for i in together]
            missing = bool(np.isnan(np.concatenate(rates)).any())
            is_valid = report is not None and report.valid and not missing
            injections.append(Injection(event, together, is_valid, report))
    return tuple(injections)


def _judged(
    injections: Sequence[Injection], events: int
) -> tuple[tuple[bool, ...], tuple[str, ...], tuple[tuple[float, float] | None, ...]]:
    """Validity, reasons and 95 % interval of the mass [mg] of every event, from the observer's own reports.

    An event is valid if all its injections are. Of one with an opening that no report covers nothing more is said.
    """
    valid, reasons, intervals = [], [], []
    for event in range(events):
        own = [each for each in injections if each.event == event]
        reports = [each.report for each in own if each.report is not None]
        valid.append(bool(own) and all(each.valid for each in own))
        reports = reports if len(reports) == len(own) else []
        named = {r.reason.name for r in reports if not r.valid} if reports else {NO_REPORT}
        reasons.append(" ".join(sorted(named)))
        bounds = [r.mass_ci95 for r in reports if r.mass_ci95 is not None]
        # the openings of an event share what is uncertain, so widths add
        low, high = (sum(each[side] for each in bounds) / MILLIGRAM for side in (0, 1))
        intervals.append((low, high) if bounds and len(bounds) == len(reports) else None)
    return tuple(valid), tuple(reasons), tuple(intervals)


def _report_of(evaluation: Evaluation, window: slice) -> InjectionReport | None:
    """The report whose window overlaps a true one most."""

    def overlap(report: InjectionReport) -> int:
        start, end = report.start_index - evaluation.first_index, report.end_index - evaluation.first_index
        return int(min(end, window.stop - 1) - max(start, window.start))

    best = max(evaluation.reports, key=overlap, default=None)
    return best if best is not None and overlap(best) > 0 else None
