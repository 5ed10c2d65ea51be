"""`tools/bench faults`: scenarios worked through on a few processes, what is shown of them, bars that are missed."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from matplotlib.figure import Figure

from observer_rt.foundation.units import MILLISECOND
from tests.observed_plants import bench_at
from tests.plants.plant import record
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import MEASURING, PACKAGE, Found, Plan, Task
from tools.benchmarks.faults import bus, inputs, player
from tools.benchmarks.faults import live as on_bus
from tools.benchmarks.faults.scenario import AND, Kind, drawn, tasks
from tools.benchmarks.faults.score import RECOVERY, FaultScore, score
from tools.benchmarks.report import NOTHING, Columns, Shown, known, mean, percentile, put_out, table_of
from tools.benchmarks.scoring import warm_up, with_signals
from tools.benchmarks.wave_recordings import fitted_model

SCENARIOS = 520
FEWEST, VALID = 500, 0.98
SEVERAL = "several at once"
KINDS: dict[str, Kind] = {kind.name: kind for part in (inputs, bus, player) for kind in part.KINDS}
_BLOCKS = {
    "rail_pressure": {"message": "RailPressureBlock"},
    "needle_lift": {"message": "NeedleLiftBlock"},
    "line_pressure": {"message": "LinePressureBlock"},
}


Results = Found[FaultScore]


def run_faults(names: tuple[str, ...], plan: Plan, is_rich: bool, given: Path | None) -> Results:
    """The plan's number of scenarios of these kinds, those not yet scored by this state of the code."""
    model = fitted_model(plan, given)[0] if is_rich else None
    campaign, todo = plan.campaign, tasks(names, plan.cases, plan.master_seed)
    kept = campaign.store("faults", FaultScore, PACKAGE, *MEASURING, *([model] if model else []))
    work, ready = partial(score_scenario, model), partial(warm_up, model)
    return campaign.found(todo, campaign.results("faults", kept, work, todo, ready))


def score_scenario(model: Path | None, task: Task) -> FaultScore:
    """Work of one process; model: the injector file, on tier B."""
    scenario = drawn(task, KINDS, is_rich=model is not None)
    outcome = record(scenario.bench)
    bench = bench_at(scenario.bench.sample_rate, model)
    if scenario.blocks:  # each signal has a message of its own
        bench = with_signals(bench, _BLOCKS)
    published = player.play(scenario, outcome.measured, bench)
    return score(scenario, outcome, published, scenario.bench.injector.density)


@dataclass(frozen=True)
class Summary:
    """Of scenarios; found_ms: median and largest; recovered: median and largest number of events; in_time: of those
    that have events after the fault, the share valid within `RECOVERY` of them; named: of those that gave a reason.
    """

    scenarios: int
    wrong_samples: int
    late_samples: int
    wrong_summaries: int
    found_ms: tuple[float, float] | None
    never_found: int
    recovered: tuple[float, int] | None
    in_time: float
    named: float | None
    free: int
    valid: float | None
    crashes: int


def summary(scores: Sequence[FaultScore]) -> Summary:
    """Of at least one."""
    found = [after / MILLISECOND for after in known(s.found_after for s in scores)]
    again = known(s.recovered_after for s in scores)
    free = sum(s.free for s in scores)
    return Summary(
        len(scores),
        sum(s.wrong_samples for s in scores),
        sum(s.late_samples for s in scores),
        sum(s.wrong_summaries for s in scores),
        (percentile(found, 50), max(found)) if found else None,
        len(scores) - len(found),
        (percentile(again, 50), max(again)) if again else None,
        sum(each <= RECOVERY for each in again) / len(scores),
        mean(known(s.is_named for s in scores)),
        free,
        sum(s.free_valid for s in scores) / free if free else None,
        sum(bool(s.crash) for s in scores),
    )


def by_kind(scores: Sequence[FaultScore]) -> dict[str, Summary]:
    """Every kind alone, and those of several at once together."""
    groups = {
        name: [s for s in scores if (SEVERAL if AND in s.class_name else s.class_name) == name]
        for name in (*KINDS, *on_bus.KINDS, SEVERAL)
    }
    return {name: summary(group) for name, group in groups.items() if group}


def missed_bars(results: Results) -> list[str]:
    """A line for every bar that is missed."""
    return list(_missed(results)) if results.results else []


def shown(results: Results) -> Iterator[Shown]:
    """Every kind a line, the total, and what is missed."""
    if results.results:
        rows = {**by_kind(results.results), "all": summary(results.results)}
        yield table_of("Faults at random times", "fault", rows, _COLUMNS)
    yield from missed_bars(results)
    yield from (f"crash: {s.label}: {s.crash}" for s in results.results if s.crash)
    yield from (f"not run: {line}" for line in results.crashes)


def faults_document(results: Results) -> dict[str, Any]:
    """`figures` over all scenarios, `details` by kind and of each that was wrong."""
    return {
        "figures": asdict(summary(results.results)) if results.results else None,
        "details": {
            "kinds": {name: asdict(each) for name, each in by_kind(results.results).items()},
            "wrong": [asdict(s) for s in results.results if s.wrong_samples or s.wrong_summaries or s.crash],
            "violations": missed_bars(results),
            "not_run": list(results.crashes),
        },
    }


def save_figure(results: Results, path: Path) -> None:
    """Time until a fault was found, and events until one was valid again, a line a kind, a dot a scenario."""
    alone = [name for name, each in by_kind(results.results).items() if name != SEVERAL]
    figure = Figure(figsize=(10, 0.24 * len(alone) + 1.5), layout="constrained")
    found, again = figure.subplots(1, 2, sharey=True)
    for row, name in enumerate(alone):
        ours = [s for s in results.results if s.class_name == name]
        times = [after / MILLISECOND for after in known(s.found_after for s in ours)]
        found.plot(np.maximum(times, 0.01), [row] * len(times), ".", color="tab:blue", alpha=0.5)
        events = known(s.recovered_after for s in ours)
        again.plot(events, [row] * len(events), ".", color="tab:green", alpha=0.5)
    found.set(xscale="log", xlabel="first sample not valid, ms after the fault", yticks=range(len(alone)))
    found.set_yticklabels(alone, fontsize=7)
    found.invert_yaxis()
    again.axvline(RECOVERY + 0.5, color="tab:red", linewidth=0.8)
    most = max([RECOVERY, *known(s.recovered_after for s in results.results)])
    again.set(xlabel="events after the fault until one is valid", xticks=range(1, most + 1))
    figure.savefig(path, dpi=150)


def _missed(results: Results) -> Iterator[str]:
    total = summary(results.results)
    bars: tuple[tuple[bool, str], ...] = (
        (total.scenarios >= FEWEST, f"{total.scenarios} scenarios, {FEWEST} are asked for"),
        (total.crashes == 0, f"{total.crashes} crashes"),
        (total.wrong_samples == 0, f"{total.wrong_samples} samples valid and wrong beyond the stated time"),
        (total.wrong_summaries == 0, f"{total.wrong_summaries} injections valid and wrong"),
        (
            (total.valid or 0.0) >= VALID,
            f"{100 * (total.valid or 0.0):.1f} % valid without a fault, {VALID:.0%} asked",
        ),
        (total.in_time == 1.0, f"{100 * total.in_time:.1f} % valid again within {RECOVERY} events"),
        (total.named in (None, 1.0), f"{100 * (total.named or 0.0):.1f} % named"),
    )
    yield from (f"missed: {text}" for is_met, text in bars if not is_met)


_COLUMNS: Columns[Summary] = {
    "scenarios": "{.scenarios}",
    "wrong while valid: samples, injections": "{.wrong_samples}, {.wrong_summaries}",
    "within the stated time": "{.late_samples}",
    "found after, ms: median, most": lambda s: (
        NOTHING if s.found_ms is None else f"{s.found_ms[0]:.2g}, {s.found_ms[1]:.3g}"
    ),
    "valid throughout": "{.never_found}",
    "valid again after events: median, most": lambda s: (
        NOTHING if s.recovered is None else f"{s.recovered[0]:g}, {s.recovered[1]}"
    ),
    "within 3": "{.in_time:.0%}",
    "cause named": "{.named:.0%}",
    "valid without a fault": "{.valid:.1%}",
    "crashes": "{.crashes}",
}


@cli.app.command(
    epilog="Examples: tools/bench faults; tools/bench faults --only frozen_line,lag_line --figure faults.png"
)
def faults(
    scenarios: Annotated[int, typer.Option(min=1, help="How many, every kind in turn.")] = SCENARIOS,
    only: Annotated[str, typer.Option(help="Kinds of faults, by commas.")] = "",
    tier: cli.TierOption = cli.Tier.A,
    model: cli.ModelOption = None,
    seed: cli.SeedOption = 1,
    workers: cli.WorkersOption = cli.PROCESSES,
    out: cli.OutOption = None,
    figure: Annotated[
        Path | None, typer.Option(help="PNG of times until found and until valid again.")
    ] = None,
    live: Annotated[
        int, typer.Option(min=0, help="So many on vcan0 instead: `tools/vcan tools/bench faults --live 16`.")
    ] = 0,
    as_json: cli.JsonOption = False,
) -> None:
    """Sensors, bus, clocks and processes that fail at random times, up to three at once: is what is valid right?"""
    names = cli.chosen_names(only, "--only", KINDS, KINDS)
    plan = Plan((), scenarios, seed, workers, out or Path("build") / f"faults-{tier}", peers=False)
    with cli.resumable("what is scored is"):
        if live:
            results = Found(tuple(on_bus.run_live(live, seed, plan.out / "live")), ())
        else:
            results = run_faults(names, plan, tier is cli.Tier.B, model)
    if figure is not None and results.results:
        save_figure(results, figure)
    put_out(as_json, faults_document(results), shown(results))
