"""`tools/bench`: the figures the work is judged by. Each benchmark's module adds its commands."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from observer_rt.foundation.errors import ObserverError
from tools.benchmarks import damage, formats, history, kalman_peers, surgery, wave_recordings  # noqa: F401
from tools.benchmarks.ablation import CLASSES_TRIED, ablation_document, ablation_shown, run_ablation
from tools.benchmarks.accuracy import Results, json_document, run_accuracy, shown
from tools.benchmarks.cases import CLASSES, LUMP_CLASSES
from tools.benchmarks.command_line import (
    PROCESSES,
    JsonOption,
    ModelOption,
    NoPeersOption,
    OutOption,
    SeedOption,
    Tier,
    TierOption,
    WorkersOption,
    app,
    chosen_names,
    messages,
    resumable,
)
from tools.benchmarks.discovery import command as discovery  # noqa: F401
from tools.benchmarks.faults import command as faults  # noqa: F401
from tools.benchmarks.figures import save_figures
from tools.benchmarks.kills import campaign, power  # noqa: F401
from tools.benchmarks.live_page import measure as live_page  # noqa: F401
from tools.benchmarks.many import run as many  # noqa: F401
from tools.benchmarks.realism import run as realism  # noqa: F401
from tools.benchmarks.report import put_out
from tools.benchmarks.runs import Plan
from tools.benchmarks.speed import measure as speed  # noqa: F401
from tools.benchmarks.wave_accuracy import WAVE_CLASSES, WavePlan, run_wave_accuracy
from tools.benchmarks.wave_plant import Variant

CASES, ABLATION_CASES, WAVE_CASES = 60, 10, 20  # per class


@app.callback()
def bench() -> None:
    """Measures the observer; each command prints a table, or a JSON document."""


@app.command(
    epilog="Examples: tools/bench accuracy --cases 10 --classes orifice_area,line_friction; "
    "tools/bench accuracy --tier B --variant step --cases 3"
)
def accuracy(
    cases: Annotated[
        int | None, typer.Option(min=1, help=f"Cases per class ({CASES}; with --ablation {ABLATION_CASES}).")
    ] = None,
    classes: Annotated[str, typer.Option(help="Classes, by commas (default: all).")] = "",
    seed: SeedOption = 1,
    workers: WorkersOption = PROCESSES,
    out: OutOption = None,
    no_peers: NoPeersOption = False,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Instead: our observer with one part changed each.")
    ] = False,
    tier: TierOption = Tier.A,
    variant: Annotated[Variant, typer.Option(help="Of tier B's line.")] = Variant.PLAIN,
    model: ModelOption = None,
    measured_rate: Annotated[
        bool,
        typer.Option(
            "--measured-rate", help="Tier B: fit with a measured rate, from an inertance 5 % wrong."
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Error of mass and rate on independent plants, against the true rate, class by class."""
    default, usual, folder = LUMP_CLASSES, CASES, "accuracy"
    if ablation:
        default, usual = CLASSES_TRIED, ABLATION_CASES
    elif tier is Tier.B:
        default, usual, folder = WAVE_CLASSES, WAVE_CASES, f"accuracy-{variant}"
    chosen = chosen_names(classes, "--classes", CLASSES, default)
    plan = Plan(chosen, cases or usual, seed, workers, out or Path("build") / folder, not no_peers)
    with resumable("what is scored is"):
        if ablation:
            scores, crashes = run_ablation(plan, messages)
            told = [str(crash) for crash in crashes]
            put_out(as_json, ablation_document(scores, told), ablation_shown(scores, crashes))
        elif tier is Tier.B:
            _show(run_wave_accuracy(WavePlan(plan, variant, model, measured_rate), messages), plan, as_json)
        else:
            _show(run_accuracy(plan, messages), plan, as_json)


def _show(found: Results, plan: Plan, as_json: bool) -> None:
    for figure in save_figures(found.scores, plan.out):
        messages.print(f"figure: {figure}", highlight=False)
    crashes = [str(crash) for crash in found.crashes]
    put_out(as_json, json_document(found.scores, crashes, found.sample_time, found.missed), shown(found))


def main() -> None:
    """Entry point."""
    try:
        app()
    except ObserverError as error:
        messages.print(f"[red]error:[/red] {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
