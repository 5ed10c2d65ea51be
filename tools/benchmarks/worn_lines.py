"""Steady wear on lines unlike the model: how often it is valid, and how far off while it is.

Every discrepancy has a plant, whose model is fitted to healthy recordings. One of a wrong length is fitted with
weighed masses, for the level of flow rests on the length.
"""

import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from tests.observed_plants import bench_at, recording_of
from tests.plants.parameters import Faults
from tests.plants.plant import Bench, Event, Outcome, Shot, Surroundings, event_start, record
from tests.plants.windows import windows_of
from tools.benchmarks.campaign import MEASURING, PACKAGE, Found, Plan, Task, digest_of
from tools.benchmarks.cases import Case
from tools.benchmarks.discovery.real_line.cases import Rig, healthy_benches, needle_of
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy, plant_of
from tools.benchmarks.report import NOTHING, Columns, Shown, crash_lines, mean, percentile, table_of
from tools.benchmarks.score import FROM, NOMINAL, OBSERVER, CaseScore
from tools.benchmarks.scoring import score_evaluation
from tools.benchmarks.wave_recordings import FITTED, NEW_PART, fit_model, kept_fit, write_recordings

CASES = 9  # of a discrepancy
EVENTS = 20
RAIL_PRESSURES, DURATIONS = (50e6, 150e6), (0.7e-3, 2.2e-3)  # Pa, s
NOZZLE, SEAT = 0.4, 0.25  # largest wear, of either sign
WEIGHED_SIGMA = 0.003  # of a mean mass
VALID_SHARE, WORST_SHARE, P95_PCT, LARGEST_PCT, COVERAGE = 0.99, 0.9375, 0.4, 0.8, (0.93, 0.98)


@dataclass(frozen=True)
class WornResults(Found[CaseScore]):
    """inadequate: plants that `fit` says the model does not describe, left out."""

    inadequate: tuple[str, ...]


def make_case(discrepancy: Discrepancy, seed: int, number: int) -> Case:
    """Wear that stands still; every second case has another operating point at each event."""
    plant = plant_of(discrepancy, seed)
    rng = np.random.default_rng([seed, discrepancy.number, number, zlib.crc32(b"worn")])
    faults = Faults(orifice_area=rng.uniform(-NOZZLE, NOZZLE), seat_area=rng.uniform(-SEAT, SEAT))
    points = [(rng.uniform(*RAIL_PRESSURES), rng.uniform(*DURATIONS)) for _ in range(EVENTS)]
    if number % 2 == 0:
        points = [points[0]] * EVENTS
    events = tuple(Event(p, (Shot(rng.uniform(0.0, 1e-5), d),), faults) for p, d in points)
    still, quiet = replace(plant.rail, dip=0.0, ripple=0.0), replace(plant.rail, pump=0.0)
    moved = (
        quiet.supply([(event_start(i) + e.shots[0].start, e.shots[0].duration)], e.rail_pressure, 0.0)
        for i, e in enumerate(events)
    )
    supply = (still.supply([], events[0].rail_pressure, rng.random()), *moved)
    around = Surroundings(supply=supply, before_noise=plant.mounting)
    needle, noise = needle_of(Rig(discrepancy.number, False, seed)), int(rng.integers(2**62))
    return Case(
        discrepancy,
        seed,
        number,
        Bench(plant.part, needle, events, seed=noise, line=plant.line, around=around),
    )


def run_worn_lines(plan: Plan) -> WornResults:
    """Fit a model to each plant, and score the cases that this state of the code has not scored."""
    scores: dict[str, CaseScore] = {}
    inadequate = []
    runs = plan.campaign
    for name in plan.classes:
        model = fitted_model(Discrepancy(name), plan)
        baseline = load_injector(model).baseline
        if baseline is None or not baseline.adequate:
            inadequate.append(name)
            continue
        kept = runs.store(f"worn-{name}", CaseScore, PACKAGE, *MEASURING, model)
        tasks = [task for task in plan.tasks if task.class_name == name]
        scores |= runs.results(name, kept, partial(score_worn, model), tasks)
    found = runs.found(plan.tasks, scores)
    return WornResults(found.results, found.crashes, tuple(inadequate))


def fitted_model(discrepancy: Discrepancy, plan: Plan) -> Path:
    """The injector file that `fit` makes of healthy recordings of a plant, anew if the code changed.

    Raises RunError where it fails.
    """
    model = plan.out / f"{discrepancy}-{plan.master_seed}" / FITTED
    return kept_fit(model, digest_of((PACKAGE, *MEASURING)), partial(_fit, discrepancy, plan, model))


def _fit(discrepancy: Discrepancy, plan: Plan, model: Path) -> None:
    folder = model.parent
    benches = healthy_benches(Rig(discrepancy.number, False, plan.master_seed))
    outcomes = {f"healthy_{number}": record(bench) for number, bench in enumerate(benches)}
    paths = list(write_recordings(folder, outcomes.items()))
    more = []
    if discrepancy is Discrepancy.LENGTH:
        weighed = folder / "masses.txt"
        rng = np.random.default_rng([plan.master_seed, zlib.crc32(b"weighed")])
        density = plant_of(discrepancy, plan.master_seed).part.density
        rows = [
            f"{path.name},{_mean_mass_mg(outcome, density) * rng.normal(1.0, WEIGHED_SIGMA):.5f}"
            for path, outcome in zip(paths, outcomes.values(), strict=True)
        ]
        weighed.write_text("\n".join(["recording,mass_mg", *rows]) + "\n")
        more = ["--mass", str(weighed)]
    fit_model(paths, folder / NEW_PART, model, more=more)


def _mean_mass_mg(outcome: Outcome, density: float) -> float:
    rate = 1.0 / (outcome.measured.time[1] - outcome.measured.time[0])
    return float(np.mean(windows_of(outcome, rate).event_masses_mg(outcome.truth.injection_rate, density)))


def score_worn(model: Path, task: Task) -> CaseScore:
    """Work of one process: record a case, and score the observer on it."""
    case = make_case(Discrepancy(task.class_name), task.master_seed, task.number)
    outcome, bench = record(case.bench), bench_at(case.bench.sample_rate, model)
    evaluation = evaluate(bench, [recording_of(outcome)]).evaluations[0]
    return score_evaluation(case, outcome, bench, evaluation, ())


def fallbacks(score: CaseScore) -> int:
    """Events from the fifth on whose mass is nearer to the nominal model's than to the truth."""
    observer, nominal, true = (
        np.array(masses[FROM:])
        for masses in (
            score.estimator(OBSERVER).mass_mg,
            score.estimator(NOMINAL).mass_mg,
            score.true_mass_mg,
        )
    )
    matters = np.abs(nominal - true) > 0.02 * true
    return int(np.sum(matters & (np.abs(observer - nominal) < np.abs(observer - true))))


def outside(score: CaseScore) -> int:
    """Events whose published mass lies outside the interval beside it."""
    masses = score.estimator(OBSERVER).mass_mg
    return sum(
        interval is not None and not interval[0] - 1e-6 <= mass <= interval[1] + 1e-6
        for mass, interval in zip(masses, score.mass_ci95_mg, strict=True)
    )


def figures(scores: Sequence[CaseScore]) -> dict[str, Any]:
    """Of some cases, over the fifth event on; errors of valid events [%]."""
    shares = [score.valid_share for score in scores]
    errors = np.concatenate([score.errors_pct() for score in scores])
    held = [score.covered(e) for score in scores for e in range(FROM, EVENTS) if score.valid[e]]
    refused = Counter(reason for score in scores for reason in score.reasons[FROM:] if reason)
    return {
        "cases": len(scores),
        "events": sum(len(score.valid) - FROM for score in scores),
        "valid_share": mean(shares),
        "valid_share_min": min(shares),
        "fallbacks": sum(map(fallbacks, scores)),
        "outside_own_interval": sum(map(outside, scores)),
        "coverage_95_share": mean([each for each in held if each is not None]),
        "error_level_pct": float(np.mean(errors)) if errors.size else None,
        "error_pct": {name: percentile(list(np.abs(errors)), q) for name, q in (("p95", 95), ("max", 100))},
        "wrong_valid": sum(score.wrong_valid for score in scores),
        "reasons": ", ".join(f"{name} {count}" for name, count in refused.most_common()) or NOTHING,
    }


COLUMNS: Columns[dict[str, Any]] = {
    "cases": "{[cases]}",
    "valid\n%": "{[valid_share]!p:.1f}",
    "worst\ncase %": "{[valid_share_min]!p:.0f}",
    "nearer to\nnominal": "{[fallbacks]}",
    "outside own\ninterval": "{[outside_own_interval]}",
    "coverage\n%": "{[coverage_95_share]!p:.0f}",
    "error %\nlevel": "{[error_level_pct]:+.2f}",
    "\np95 / max": "{[error_pct][p95]:.2f} / {[error_pct][max]:.2f}",
    "wrong\nvalid": "{[wrong_valid]}",
    "refused": "{[reasons]}",
}


def by_discrepancy(scores: Sequence[CaseScore]) -> dict[str, dict[str, Any]]:
    """Figures of each plant, and of all."""
    names = dict.fromkeys(score.class_name for score in scores)
    found = {name: figures([s for s in scores if s.class_name == name]) for name in names}
    return {**found, "all": figures(scores)}


def violations(scores: Sequence[CaseScore]) -> tuple[str, ...]:
    """A line for every bar that is missed."""
    found = figures(scores)
    share, worst, held = found["valid_share"], found["valid_share_min"], found["coverage_95_share"]
    p95, largest = found["error_pct"]["p95"], found["error_pct"]["max"]
    nearer, beyond, wrong = found["fallbacks"], found["outside_own_interval"], found["wrong_valid"]
    bars = (
        (share >= VALID_SHARE, f"valid {share:.1%}, bar {VALID_SHARE:.0%}"),
        (worst >= WORST_SHARE, f"worst case valid {worst:.0%}, bar {WORST_SHARE:.1%}"),
        (nearer == 0, f"{nearer} masses nearer to the nominal model's than to the truth"),
        (beyond == 0, f"{beyond} masses outside their own interval"),
        (p95 <= P95_PCT, f"error p95 {p95:.2f} %, bar {P95_PCT:g} %"),
        (largest <= LARGEST_PCT, f"largest error {largest:.2f} %, bar {LARGEST_PCT:g} %"),
        (
            COVERAGE[0] <= held <= COVERAGE[1],
            f"coverage {held:.1%}, bar {COVERAGE[0]:.0%} to {COVERAGE[1]:.0%}",
        ),
        (wrong == 0, f"{wrong} events wrong while valid"),
    )
    return tuple(f"bar missed: {words}" for holds, words in bars if not holds)


def shown(results: WornResults) -> Iterator[Shown]:
    """The table, then a line for every bar that is missed and every crash."""
    yield table_of(
        "worn injectors on fitted lines, fifth event on", "plant", by_discrepancy(results.results), COLUMNS
    )
    yield from violations(results.results)
    yield from (f"{name}: left out, its fit is INADEQUATE" for name in results.inadequate)
    yield from crash_lines(results.crashes)


def json_document(results: WornResults) -> dict[str, Any]:
    """`figures` over all plants, `details` by plant."""
    return {
        "figures": figures(results.results),
        "details": {
            "plants": by_discrepancy(results.results),
            "violations": list(violations(results.results)),
            "inadequate": list(results.inadequate),
            "crashes": list(results.crashes),
        },
    }
