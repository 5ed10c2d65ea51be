"""`tools/bench accuracy --tier B`: a model fitted to healthy recordings of the richer plant; all classes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console

from observer_rt.config.bench import load_injector
from tools.benchmarks.accuracy import Results, joined
from tools.benchmarks.bars import WEAR, above, by_class, coverage, rate_coverages, slow_sample, x3_ratios
from tools.benchmarks.cases import Case, make_case, on_real_line
from tools.benchmarks.command_line import tracked
from tools.benchmarks.peers import PeerScore, lumps_of, score_wave_peers
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.report import clopper_pearson
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Plan, on_case
from tools.benchmarks.sample_time import measure_sample_time
from tools.benchmarks.score import CaseScore
from tools.benchmarks.scoring import score_case, warm_up
from tools.benchmarks.wave_plant import Variant
from tools.benchmarks.wave_recordings import NEW_PART, fit_model, healthy_benches, write_recordings

FITTED = "fitted.toml"
PEER_CASES = 4  # of a class: a joint UKF takes some 15 s a recording
WAVE_CLASSES = (
    "healthy",
    "orifice_area",
    "seat_area",
    "orifice_and_seat_area",
    "guide_leakage",
    "chamber_pressure_rise",
    "orifice_cavitation",
    "line_friction",
    "line_pressure_sensor_offset",
    "line_pressure_sensor_lag",
    "rail_pressure_sensor_offset",
    "bulk_modulus",
    "entrained_air",
    "mixture",
    "wear_averaged_20_khz",
)
"""With the faults and schedules of the bars, on another injector and line."""
VARIANT_PCT = 1.5  # mass of what is valid on a line the structures do not contain
X3_RATIO = 10.0
MASS_COVERAGE = (0.90, 0.98)  # of a class
RATE_COVERAGE = 0.90  # of all classes together


@dataclass(frozen=True)
class WavePlan:
    """A plan on one variant of the richer plant.

    model: the injector file to use instead of fitting one; measured_rate: the fit has a measured rate, and starts
    from a wrong inertance.
    """

    plan: Plan
    variant: Variant
    model: Path | None = None
    measured_rate: bool = False


def make_wave_case(variant: Variant, class_name: str, master_seed: int, number: int) -> Case:
    """The case with this number; a master seed has one injector. Raises KeyError for an unknown class."""
    case = make_case(class_name, master_seed, number)
    return replace(case, bench=on_real_line(case.bench, master_seed, variant))


def run_wave_accuracy(wave: WavePlan, console: Console) -> Results:
    """Record, fit, and score the cases not yet scored with this model; progress goes to `console`."""
    plan, variant = wave.plan, wave.variant
    model, healthy = fitted_model(wave, console)
    runs = plan.campaign(console)
    make, ready = partial(make_wave_case, variant), partial(warm_up, model)
    kept = runs.store(f"observer-{variant}", CaseScore, PACKAGE, BENCHMARKS, model)
    scores = runs.results(
        "observer", kept, partial(on_case, make, partial(score_case, model=model)), plan.tasks, ready
    )
    if plan.peers:
        tasks = [task for task in plan.tasks if task.number < PEER_CASES]
        work = partial(on_case, make, partial(score_wave_peers, lumps=lumps_of(list(healthy.values()))))
        kept_peers = runs.store(f"peers-{variant}", PeerScore, BENCHMARKS)
        scores = joined(scores, runs.results("peers", kept_peers, work, tasks, ready))
    found, took = plan.in_order(scores), measure_sample_time(model)
    return Results(found, runs.crashes, took, (*wave_violations(found, variant), *slow_sample(took)))


def fitted_model(wave: WavePlan, console: Console) -> tuple[Path, dict[str, Outcome]]:
    """The injector file of a plan, fitted unless it is given, and the healthy recordings where they are wanted."""
    healthy = {}
    if wave.plan.peers or wave.model is None:
        benches = healthy_benches(wave.variant, wave.plan.master_seed)
        healthy = {name: record(benches[name]) for name in tracked(benches, "recording", console)}
    model = wave.model or _fitted(wave, healthy, console)
    load_injector(model)  # refused here, not in every process
    return model, healthy


def _fitted(wave: WavePlan, healthy: dict[str, Outcome], console: Console) -> Path:
    """The model `observer-rt fit` makes of the recordings, as its user would have it."""
    out = wave.plan.out
    recordings = list(write_recordings(out / "healthy", healthy.items(), wave.measured_rate))
    fitted = out / FITTED
    console.print(fit_model(recordings, out / "healthy" / NEW_PART, fitted), highlight=False, markup=False)
    return fitted


@dataclass(frozen=True)
class WaveBars:
    """Limits of every case of a class on the plain line: mass error [%] and RMSE [mm3/ms]; and the valid share."""

    mass_pct: float
    rmse: float | None
    valid_share: float = 0.95


HEALTHY = WaveBars(0.3, 0.4)
FAULTY = WaveBars(0.6, 0.6)
HARD = WaveBars(1.0, None)
AVERAGED = WaveBars(1.0, 1.2)
BARS = {
    "healthy": HEALTHY,
    **dict.fromkeys(
        (
            *WEAR,
            "guide_leakage",
            "chamber_pressure_rise",
            "orifice_cavitation",
            "line_pressure_sensor_offset",
        ),
        FAULTY,
    ),
    **dict.fromkeys(("line_friction", "line_pressure_sensor_lag"), HARD),
    "wear_averaged_20_khz": AVERAGED,
}


def wave_violations(scores: Sequence[CaseScore], variant: Variant) -> list[str]:
    """A line for every class and every case that misses a bar."""
    lines = [
        f"{s.class_name} {s.number}: {s.wrong_valid} events valid and wrong" for s in scores if s.wrong_valid
    ]
    if variant is not Variant.PLAIN:
        return [*lines, *_variant_violations(scores)]
    for name, cases in by_class(scores).items():
        if name in BARS:
            lines += _class_violations(name, cases, BARS[name])
    if (shares := rate_coverages(scores)) and np.mean(shares) < RATE_COVERAGE:
        lines.append(f"all: coverage of the 95 % interval of the rate: {np.mean(shares):.1%} < 90 %")
    return lines


def _variant_violations(scores: Sequence[CaseScore]) -> Iterator[str]:
    for s in scores:
        error = s.valid_mass_error_pct()
        if error is not None:
            place = f"{s.class_name} {s.number}"
            yield from above(place, "mass error of the valid events [%]", abs(error), VARIANT_PCT)


def _class_violations(name: str, cases: Sequence[CaseScore], bars: WaveBars) -> Iterator[str]:
    yield from above(
        name, "mass error, largest [%]", max(abs(s.mass_error_pct()) for s in cases), bars.mass_pct
    )
    if bars.rmse is not None:
        yield from above(name, "RMSE, largest [mm3/ms]", max(s.rate_rmse() for s in cases), bars.rmse)
    if (share := float(np.mean([s.valid_share for s in cases]))) < bars.valid_share:
        yield f"{name}: valid share: {share:.1%} < {bars.valid_share:.0%}"
    if (ratios := x3_ratios(cases)) and min(ratios) < X3_RATIO:
        yield f"{name}: x3-MSE ratio, smallest: {min(ratios):.3g} < {X3_RATIO:g}"
    if covered := coverage(cases):
        low, high = clopper_pearson(sum(covered), len(covered))
        if high < MASS_COVERAGE[0] or low > MASS_COVERAGE[1]:
            yield f"{name}: coverage of the 95 % interval of the mass: {np.mean(covered):.1%}, not 90-98 %"
