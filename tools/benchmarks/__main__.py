"""`tools/bench`: the figures the work is judged by."""

import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from observer_rt.foundation.errors import ObserverError, UserError
from observer_rt.terminal.console import progress_bar
from tools.benchmarks import history as history_command
from tools.benchmarks import wave_recordings
from tools.benchmarks.ablation import CLASSES_TRIED, ablation_document, ablation_tables, run_ablation
from tools.benchmarks.accuracy import Results, json_document, print_results, run_accuracy
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
    chosen_names,
    finite,
    messages,
    print_lines,
    put_out,
    resumable,
    screen,
)
from tools.benchmarks.damage import damage_document, damage_table, run_damage
from tools.benchmarks.discovery import command as discovery_command
from tools.benchmarks.faults import command as faults_command
from tools.benchmarks.figures import save_figures
from tools.benchmarks.formats import formats_document, formats_table, measure_formats
from tools.benchmarks.kalman_peers import Trial, grid, joint_ekf, joint_ukf, trials, tuning_table
from tools.benchmarks.kills import power as power_command
from tools.benchmarks.kills.campaign import Plan as KillPlan
from tools.benchmarks.kills.campaign import kills_document, kills_table, run_campaign
from tools.benchmarks.live_page.measure import measure_page, page_document, page_table
from tools.benchmarks.many.run import FULL, QUICK, many_document, measure_many, print_many
from tools.benchmarks.realism import run as realism_command
from tools.benchmarks.runs import Plan
from tools.benchmarks.speed import measure as speed_command
from tools.benchmarks.surgery import findings_table, operate, surgeries
from tools.benchmarks.wave_accuracy import WAVE_CLASSES, WavePlan, run_wave_accuracy
from tools.benchmarks.wave_plant import Variant

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
app.command(epilog=wave_recordings.EXAMPLE)(wave_recordings.wave_recordings)
app.command(epilog=discovery_command.EXAMPLE)(discovery_command.discovery)
app.command(epilog=realism_command.EXAMPLE)(realism_command.realism)
app.command(epilog=faults_command.EXAMPLE)(faults_command.faults)
app.command(epilog=history_command.EXAMPLE)(history_command.history)
app.command(epilog=power_command.EXAMPLE)(power_command.power)
app.command(epilog=speed_command.EXAMPLE)(speed_command.speed)
app.command(epilog=speed_command.SOAK_EXAMPLE)(speed_command.soak)
FILTERS = {"ukf": joint_ukf, "ekf": joint_ekf}
CASES, ABLATION_CASES, WAVE_CASES = 60, 10, 20  # per class


@app.callback()
def bench() -> None:
    """Measures the observer; each command prints a table, or a JSON document."""


@app.command(epilog="Examples: tools/bench batch; tools/bench batch --quick --json")
def batch(
    quick: Annotated[bool, typer.Option("--quick", help="Few and short files: a look, no verdict.")] = False,
    as_json: JsonOption = False,
) -> None:
    """What many recordings cost through `observer-rt batch`, beside the compiled core alone."""
    found = measure_many(
        QUICK if quick else FULL, lambda text: messages.print(f"{text} ...", highlight=False)
    )
    put_out(as_json, lambda: finite(many_document(found)), lambda console: print_many(found, console), 150)


@app.command(epilog="Examples: tools/bench monitor; tools/bench monitor --injectors 3 --seconds 20")
def monitor(
    seconds: Annotated[float, typer.Option(min=1.0, help="How long each page is watched.")] = 60.0,
    injectors: Annotated[int, typer.Option(min=1, max=8, help="Side by side, each on a bus.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """How smoothly the live page is drawn in a real browser, beside a bare page; exit code 1 where it is not."""
    with tempfile.TemporaryDirectory(prefix="monitor-") as folder:
        found = measure_page(Path(folder), seconds, injectors)
    put_out(as_json, lambda: page_document(found), lambda console: console.print(page_table(found)), 120)
    if not found.is_met:
        raise typer.Exit(1)


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
            _ablation(plan, as_json)
        elif tier is Tier.B:
            _show(run_wave_accuracy(WavePlan(plan, variant, model, measured_rate), messages), plan, as_json)
        else:
            _show(run_accuracy(plan, messages), plan, as_json)


@app.command(epilog="Example: tools/bench formats --frames 100000")
def formats(
    frames: Annotated[int, typer.Option(min=1000, help="CAN frames, or as many samples.")] = 50_000,
    as_json: JsonOption = False,
) -> None:
    """What each file format holds, how exactly it keeps time, and how fast it is written and read."""
    found = measure_formats(frames)
    put_out(as_json, lambda: formats_document(found), lambda console: console.print(formats_table(found)))


@app.command(epilog="Example: tools/bench damage --files 5000 --seed 1")
def damage(
    files: Annotated[int, typer.Option(min=1, help="Damaged files.")] = 5000,
    flips: Annotated[bool, typer.Option("--flips", help="Single bits, of MF4 and Parquet only.")] = False,
    seed: SeedOption = 1,
    workers: WorkersOption = PROCESSES,
    as_json: JsonOption = False,
) -> None:
    """What becomes of damaged files of every format; exit code 1 if one crashes, or shows a traceback."""
    campaign = run_damage(files, seed, workers, messages, flips)
    put_out(as_json, lambda: damage_document(campaign), lambda console: console.print(damage_table(campaign)))
    for fault in campaign.faults:
        messages.print(f"{fault.task}: {fault.said}", markup=False, highlight=False, soft_wrap=True)
    if campaign.faults:
        raise typer.Exit(1)


@app.command(epilog="Example: tools/bench surgery")
def surgery() -> None:
    """Whether anything wrong is ever valid: faults in recordings, for every way of learning."""
    todo = surgeries()
    with progress_bar(messages, "surgeries", len(todo)) as advance:
        found = []
        for number, each in enumerate(todo, 1):
            found.append(operate(each))
            advance(number)
    screen().print(findings_table(found))


@app.command(
    epilog="Example: tools/bench kills --kills 20; tools/vcan tools/bench kills --interface socketcan"
)
def kills(
    kills: Annotated[int, typer.Option(min=1, help="How many daemons are killed.")] = 120,
    seed: SeedOption = 1,
    within: Annotated[float, typer.Option(min=0.1, max=3600, help="save_within_s of the bench file.")] = 1.0,
    interface: Annotated[
        str, typer.Option(help="virtual, or socketcan with a channel that is up.")
    ] = "virtual",
    channel: Annotated[str, typer.Option(help="Channel of the interface.")] = "vcan0",
    small_disk: Annotated[
        bool, typer.Option("--small-disk", help="--out is on a disk of few MB: fill it, instead of a limit.")
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder for the daemons' files, which are removed first.")] = Path(
        "build/kills"
    ),
    as_json: JsonOption = False,
) -> None:
    """Kill daemons that learn at random moments (kill -9): what is lost, and is the rest whole?"""
    plan = KillPlan(kills, seed, out, within, interface, channel, small_disk=small_disk)
    with progress_bar(messages, "killing", float(kills)) as progress:
        found = list(run_campaign(plan, progress))
    put_out(
        as_json,
        lambda: kills_document(found, plan),
        lambda console: console.print(kills_table(found, plan)),
    )
    problems = [problem for kill in found for problem in kill.problems]
    print_lines(messages, problems)
    if problems:
        raise typer.Exit(1)


@app.command(epilog="Example: tools/bench peer-tuning --peer ekf")
def peer_tuning(peer: Annotated[str, typer.Option(help="Which filter: ukf or ekf.")] = "ukf") -> None:
    """The grid the joint Kalman filters' noise settings were chosen from, best first (minutes)."""
    if peer not in FILTERS:
        raise UserError("--peer", f"unknown filter '{peer}'", f"known: {', '.join(FILTERS)}")
    tried: list[Trial] = []
    with progress_bar(messages, f"tuning {peer}", float(len(grid()))) as progress:
        for trial in trials(FILTERS[peer]):
            tried.append(trial)
            progress(float(len(tried)))
    screen().print(tuning_table(sorted(tried, key=lambda trial: trial.rmse)))


def _show(found: Results, plan: Plan, as_json: bool) -> None:
    for figure in save_figures(found.scores, plan.out):
        messages.print(f"figure: {figure}", highlight=False)
    crashes = [str(crash) for crash in found.crashes]
    put_out(
        as_json,
        lambda: json_document(found.scores, crashes, found.sample_time, found.missed),
        lambda console: print_results(found, console),
    )


def _ablation(plan: Plan, as_json: bool) -> None:
    scores, crashes = run_ablation(plan, messages)

    def show(console: Console) -> None:
        for table in ablation_tables(scores):
            console.print(table)
        print_lines(console, [f"{crash.task}: {crash.message}" for crash in crashes], "crash: ")

    put_out(as_json, lambda: ablation_document(scores, [str(crash) for crash in crashes]), show)


def main() -> None:
    """Entry point."""
    try:
        app()
    except ObserverError as error:
        messages.print(f"[red]error:[/red] {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
