"""The commands `speed` and `soak` of `tools/bench`."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from tools.benchmarks.command_line import JsonOption, chosen_names, finite, messages, print_lines, put_out
from tools.benchmarks.speed.histogram import save_histograms
from tools.benchmarks.speed.measure import Part, SpeedPlan, measure_speed
from tools.benchmarks.speed.report import print_speed, speed_document
from tools.benchmarks.speed.soak import run_soak, soak_table

EXAMPLE = (
    "Examples: tools/bench speed --figures build/speed; tools/bench speed --quick --only sample,training"
)
SOAK_EXAMPLE = "Example: tools/bench soak --minutes 60"
SECONDS, QUICK_SECONDS = 600.0, 10.0
ROUNDTRIP_SECONDS, QUICK_ROUNDTRIP_SECONDS = 50.0, 5.0
INJECTORS_SECONDS, QUICK_INJECTORS_SECONDS = 60.0, 10.0
TABLE_WIDTH = 170  # where stdout is no terminal


def speed(
    only: Annotated[str, typer.Option(help=f"Of {', '.join(Part)}, by commas (default: all).")] = "",
    quick: Annotated[
        bool, typer.Option("--quick", help="10 s of each, and no cold start: a look, no verdict.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(min=1.0, help="Of the sustained rate (600).")] = None,
    figures: Annotated[Path | None, typer.Option(help="Folder for the histogram of latencies.")] = None,
    as_json: JsonOption = False,
) -> None:
    """How fast, each beside a named peer: round trip, rate, a sample, training, start, scaling."""
    plan = SpeedPlan(
        tuple(map(Part, chosen_names(only, "--only", list(Part), list(Part)))),
        seconds or (QUICK_SECONDS if quick else SECONDS),
        QUICK_ROUNDTRIP_SECONDS if quick else ROUNDTRIP_SECONDS,
        QUICK_INJECTORS_SECONDS if quick else INJECTORS_SECONDS,
        cold=not quick,
    )
    found = measure_speed(plan, messages)
    if figures is not None and (figure := save_histograms(found, figures)):
        messages.print(f"figure: {figure}", highlight=False)
    put_out(
        as_json,
        lambda: finite(speed_document(found)),
        lambda console: print_speed(found, console),
        TABLE_WIDTH,
    )


def soak(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 10.0,
    as_json: JsonOption = False,
) -> None:
    """A learning daemon at 100 kHz, its Python paused at random: what grows, what is lost? Exit code 1 for a loss."""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        found = run_soak(Path(folder), minutes)
    put_out(
        as_json,
        lambda: finite(found.document()),
        lambda console: console.print(soak_table(found)),
        TABLE_WIDTH,
    )
    if not as_json:
        print_lines(messages, [found.farewell])
    if found.lost or found.repeated:
        raise typer.Exit(1)
