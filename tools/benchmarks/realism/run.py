"""`tools/bench realism`: disturbed recordings, scored on a few processes, resumably."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from observer_rt.config.signals import SignalConfig
from observer_rt.desk.evaluation.evaluate import Evaluation, evaluate
from observer_rt.engine.estimation.scalars import NOZZLE, SEAT
from tests.observed_plants import recording_of
from tests.plants.plant import record
from tests.plants.windows import Windows, windows_of
from tools.benchmarks import command_line as cli
from tools.benchmarks import scoring
from tools.benchmarks.accuracy import joined
from tools.benchmarks.campaign import MEASURING, PACKAGE, Plan, Task
from tools.benchmarks.kalman_peers import joint_ukf
from tools.benchmarks.peer_equations import Model, peer_inputs
from tools.benchmarks.peers import FITTED_LUMP, TUNING, PeerScore, lumps_of, peer_score
from tools.benchmarks.realism.catalogue import (
    DISTURBANCES,
    Entry,
    Selection,
    entries,
    make_realism_case,
    name_of,
    parsed,
)
from tools.benchmarks.realism.disturbance import Stated
from tools.benchmarks.realism.score import Interval, Results, RunScore, realism_document, shown
from tools.benchmarks.report import put_out
from tools.benchmarks.score import UKF
from tools.benchmarks.wave_recordings import fitted_model

CASES = 3  # each has another wear
TABLE_WIDTH = 200  # where stdout is no terminal


def run_realism(entries: Sequence[Entry], plan: Plan, is_rich: bool, given: Path | None) -> Results:
    """Score the runs not yet scored by this state of the code; the plan's classes are not looked at.

    is_rich: on the plant of tier B; given: its injector file, instead of fitting one.
    """
    names = {name_of(e): all(is_known(s.stated) for s in e) for e in entries}
    plan = replace(plan, classes=tuple(name for name, known in names.items() if known))
    model, lump, sources = None, None, [PACKAGE, *MEASURING]
    if is_rich:
        model, healthy = fitted_model(plan, given)
        lump = lumps_of(list(healthy.values()))[FITTED_LUMP] if plan.peers else None
        sources.append(model)
    ready, campaign = partial(scoring.warm_up, model), plan.campaign
    kept = campaign.store("observer", RunScore, *sources)
    runs = campaign.results("observer", kept, partial(score_run, model), plan.tasks, ready)
    if plan.peers:
        tasks = [t for t in plan.tasks if not any(s.is_stated for s in parsed(t.class_name))]
        kept_peers = campaign.store("peers", PeerScore, *MEASURING)
        peers = campaign.results("peers", kept_peers, partial(score_peer, is_rich, lump), tasks, ready)
        cases = joined({label: run.case for label, run in runs.items()}, peers)
        runs = {label: replace(run, case=cases[label]) for label, run in runs.items()}
    not_known = tuple(name for name, known in names.items() if not known)
    found = campaign.found(plan.tasks, runs)
    return Results(found.results, found.crashes, not_known)


def is_known(stated: Stated) -> bool:
    """Whether a bench file may say this."""
    return all(key in SignalConfig.model_fields for keys in stated.values() for key in keys)


def score_run(model: Path | None, task: Task) -> RunScore:
    """Work of one process: our observer on a disturbed recording; model: the injector file, on tier B."""
    case = make_realism_case(task, is_rich=model is not None)
    outcome = record(case.bench)
    bench = scoring.bench_for_case(case, model)
    for each in parsed(task.class_name):
        bench = scoring.with_signals(bench, each.stated)
    with scoring.timed_training() as training:
        evaluation = evaluate(bench, [recording_of(outcome)]).evaluations[0]
    windows = windows_of(outcome, case.bench.sample_rate)
    return RunScore(
        class_name=task.class_name,
        master_seed=task.master_seed,
        number=task.number,
        wear=case.bench.events[-1].faults.orifice_area,
        case=scoring.score_evaluation(case, outcome, bench, evaluation, training),
        nozzle_ci95=_intervals(evaluation, windows, NOZZLE),
        seat_ci95=_intervals(evaluation, windows, SEAT),
        phantoms=phantoms(evaluation, windows),
    )


def score_peer(is_rich: bool, lump: Model | None, task: Task) -> PeerScore:
    """Work of one process: the joint UKF on a disturbed recording, in tier B with a model fitted as ours."""
    case = make_realism_case(task, is_rich)
    outcome = record(case.bench)
    rate = joint_ukf(peer_inputs(outcome.measured, lump), TUNING).rate
    return peer_score(case, outcome, {UKF: rate})


def phantoms(evaluation: Evaluation, windows: Windows) -> int:
    """Valid injections of which no sample is in a window of a true opening."""
    inside = np.zeros(evaluation.samples + 1, np.int64)
    for window in windows.ranges:
        inside[window.start + 1 : window.stop + 1] = 1
    before = np.cumsum(inside)
    first = evaluation.first_index
    return sum(
        bool(before[min(r.end_index - first, evaluation.samples - 1) + 1] == before[r.start_index - first])
        for r in evaluation.reports
        if r.valid
    )


def _intervals(evaluation: Evaluation, windows: Windows, effect: str) -> tuple[Interval, ...]:
    """95 % interval of an indicator, by the last report of every event; only a valid one counts."""
    found: list[Interval] = []
    for event in range(len(windows.of_event)):
        reports = scoring.reports_of(evaluation, windows, event)
        said = reports[-1].indicators.get(effect) if reports and reports[-1].valid else None
        found.append(None if said is None else said.ci95)
    return tuple(found)


@cli.app.command(
    epilog="Examples: tools/bench realism --set table; "
    "tools/bench realism --only hum_50_hz_line,frozen_line --cases 1"
)
def realism(
    cases: Annotated[
        int, typer.Option(min=1, help="Recordings of each size; three have three wears.")
    ] = CASES,
    only: Annotated[
        str, typer.Option(help="Disturbances, or lines of the table ('frozen_line 0.2'), by commas.")
    ] = "",
    selection: Annotated[
        Selection, typer.Option("--set", help="All; those of the table of sizes to be right; random pairs.")
    ] = Selection.ALL,
    tier: cli.TierOption = cli.Tier.A,
    model: cli.ModelOption = None,
    seed: cli.SeedOption = 1,
    workers: cli.WorkersOption = cli.PROCESSES,
    out: cli.OutOption = None,
    no_peers: cli.NoPeersOption = False,
    as_json: cli.JsonOption = False,
) -> None:
    """Signals of a real bench: hum, drift, spikes, lag, ... on independent plants; right, or truly refused?"""
    known = (*DISTURBANCES, *map(name_of, entries(selection, (), seed)))
    found = entries(selection, cli.chosen_names(only, "--only", known, ()), seed)
    plan = Plan((), cases, seed, workers, out or Path("build") / f"realism-{tier}", not no_peers)
    with cli.resumable("what is scored is"):
        results = run_realism(found, plan, tier is cli.Tier.B, model)
    put_out(as_json, realism_document(results), shown(results), TABLE_WIDTH)
