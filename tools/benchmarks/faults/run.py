"""Scenarios worked through on a few processes, resumably."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from tools.benchmarks.faults import bus, inputs, player
from tools.benchmarks.faults.scenario import Kind, drawn, tasks
from tools.benchmarks.faults.score import FaultScore, score
from tools.benchmarks.plant import record
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Crash, Plan, Task
from tools.benchmarks.scoring import bench_at, warm_up, with_signals
from tools.benchmarks.wave_recordings import fitted_model

KINDS: dict[str, Kind] = {kind.name: kind for part in (inputs, bus, player) for kind in part.KINDS}
_BLOCKS = {
    "rail_pressure": {"message": "RailPressureBlock"},
    "needle_lift": {"message": "NeedleLiftBlock"},
    "line_pressure": {"message": "LinePressureBlock"},
}


@dataclass(frozen=True)
class Results:
    """What came out."""

    scores: tuple[FaultScore, ...]
    crashes: tuple[Crash[Task], ...]


def run_faults(names: tuple[str, ...], plan: Plan, is_rich: bool, given: Path | None) -> Results:
    """The plan's number of scenarios of these kinds, those not yet scored by this state of the code."""
    model = None
    if is_rich:
        model, _ = fitted_model(plan, given)
    ready = partial(warm_up, model)
    campaign = plan.campaign
    kept = campaign.store("faults", FaultScore, PACKAGE, BENCHMARKS, *(() if model is None else (model,)))
    todo = tasks(names, plan.cases, plan.master_seed)
    scores = campaign.results("faults", kept, partial(score_scenario, model), todo, ready)
    return Results(tuple(scores[each.label] for each in todo if each.label in scores), campaign.crashes)


def score_scenario(model: Path | None, task: Task) -> FaultScore:
    """Work of one process; model: the injector file, on tier B."""
    scenario = drawn(task, KINDS, is_rich=model is not None)
    outcome = record(scenario.bench)
    bench = bench_at(scenario.bench.sample_rate, model)
    if scenario.blocks:  # each signal has a message of its own
        bench = with_signals(bench, _BLOCKS)
    published = player.play(scenario, outcome.measured, bench)
    return score(scenario, outcome, published, scenario.bench.injector.density)
