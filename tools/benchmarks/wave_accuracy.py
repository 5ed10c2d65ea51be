"""`tools/bench accuracy --tier B`: a model fitted to healthy recordings of the richer plant; all classes."""

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.foundation.console import progress_bar
from observer_rt.foundation.errors import RunError
from tools.benchmarks.accuracy import Results, joined
from tools.benchmarks.bars import slow_sample
from tools.benchmarks.cases import Case, make_case
from tools.benchmarks.fitted_lump import lumps_of, score_wave_peers
from tools.benchmarks.peers import PeerScore
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Plan, on_case
from tools.benchmarks.sample_time import measure_sample_time
from tools.benchmarks.score import CaseScore
from tools.benchmarks.scoring import score_case, short_case
from tools.benchmarks.wave_bars import wave_violations
from tools.benchmarks.wave_plant import LINES, Variant, real_part
from tools.benchmarks.wave_recordings import NEW_PART, healthy_benches, write_recordings

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
    bench = replace(case.bench, injector=real_part(master_seed), line=LINES[variant])
    return replace(case, bench=bench)


def run_wave_accuracy(wave: WavePlan, console: Console) -> Results:
    """Record, fit, and score the cases not yet scored with this model; progress goes to `console`."""
    plan, variant = wave.plan, wave.variant
    model, healthy = fitted_model(wave, console)
    runs = plan.campaign(console)
    make, ready = partial(make_wave_case, variant), partial(warm_up_model, model)
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
    healthy = _recorded(wave, console) if wave.plan.peers or wave.model is None else {}
    model = wave.model or _fitted(wave, healthy, console)
    load_injector(model)  # refused here, not in every process
    return model, healthy


def warm_up_model(model: Path) -> None:
    """Compile, or load from the cache, what the model needs, so that no case's training time holds it."""
    score_case(short_case(), model)


def _recorded(wave: WavePlan, console: Console) -> dict[str, Outcome]:
    benches = healthy_benches(wave.variant, wave.plan.master_seed)
    outcomes = {}
    with progress_bar(console, "recording", float(len(benches))) as progress:
        for number, (name, bench) in enumerate(benches.items(), 1):
            outcomes[name] = record(bench)
            progress(float(number))
    return outcomes


def _fitted(wave: WavePlan, healthy: dict[str, Outcome], console: Console) -> Path:
    """The model `observer-rt fit` makes of the recordings, as its user would have it."""
    out = wave.plan.out
    recordings = list(write_recordings(out / "healthy", healthy.items(), wave.measured_rate))
    fitted = out / FITTED
    _observer_rt(
        console,
        ["fit", *map(str, recordings), "--model", str(out / "healthy" / NEW_PART)],
        ["--output", str(fitted), "--force"],
    )
    return fitted


def _observer_rt(console: Console, *arguments: Sequence[str]) -> None:
    command = [sys.executable, "-m", "observer_rt", *(a for part in arguments for a in part)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    console.print(done.stdout, highlight=False, markup=False)
    if done.returncode:
        raise RunError(f"observer-rt fit ended with {done.returncode}: {done.stderr.strip()}")
