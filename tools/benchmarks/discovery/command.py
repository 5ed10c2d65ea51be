"""The command `discovery` of `tools/bench`."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from observer_rt.foundation.errors import UserError
from tools.benchmarks import command_line as cli
from tools.benchmarks.discovery import run, tables
from tools.benchmarks.discovery.asking import Asking
from tools.benchmarks.discovery.cases import HidingPlan
from tools.benchmarks.discovery.figures import save_figures
from tools.benchmarks.discovery.hidden import HIDDEN
from tools.benchmarks.discovery.outside import run as outside_run
from tools.benchmarks.discovery.outside import tables as outside_tables
from tools.benchmarks.discovery.outside.cases import Asked, OutsidePlan
from tools.benchmarks.discovery.outside.kinds import KINDS, VOCABULARY_KINDS
from tools.benchmarks.discovery.real_line import tables as real_tables
from tools.benchmarks.discovery.real_line.cases import RealPlan, names_of, shared_out
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.discovery.real_line.fitting import record_only
from tools.benchmarks.report import put_out

CASES, REAL_CASES, OUTSIDE_CASES = 300, 150, 150
RATES = {"without": (False,), "with": (True,), "both": (False, True)}


@cli.app.command(
    epilog="Examples: tools/bench discovery --cases 40 --effects lift_offset,seat_area --rate without; "
    "tools/bench discovery --tier B --cases 20 --discrepancy taper; tools/bench discovery --outside --all-kinds"
)
def discovery(
    cases: Annotated[
        int | None,
        typer.Option(
            min=0,
            help=f"Faulty cases, and as many healthy ones ({CASES}); of all kinds together in tier B "
            f"({REAL_CASES}) and outside ({OUTSIDE_CASES}).",
        ),
    ] = None,
    effects: Annotated[
        str, typer.Option(help="Hidden effects, by commas (default: all); tier B: also a+b, healthy.")
    ] = "",
    rate: Annotated[str, typer.Option(help="Measured rate: without, with or both.")] = "both",
    tier: Annotated[
        cli.Tier,
        typer.Option(help="A: plants of the nominal structure. B: others, to which `fit` fits first."),
    ] = cli.Tier.A,
    healthy: Annotated[
        int | None, typer.Option(min=0, help="Tier B: healthy cases, beside the others (default: a fifth).")
    ] = None,
    discrepancy: Annotated[
        list[Discrepancy] | None, typer.Option(help="Tier B: of the plants; repeatable (default: all).")
    ] = None,
    only_record: Annotated[
        bool, typer.Option("--record-only", help="Tier B: only record and fit, into --out; nothing is asked.")
    ] = False,
    outside: Annotated[
        bool, typer.Option("--outside", help="Instead: what no vocabulary has, and what is proposed for it.")
    ] = False,
    all_kinds: Annotated[
        bool, typer.Option("--all-kinds", help="With --outside: a case of everything, for each --rate.")
    ] = False,
    seed: cli.SeedOption = 1,
    workers: cli.WorkersOption = cli.PROCESSES,
    out: cli.OutOption = None,
    as_json: cli.JsonOption = False,
) -> None:
    """Whether `discover` names effects hidden in recordings of independent plants."""
    if rate not in RATES:
        raise UserError("--rate", f"is '{rate}'", f"give {', '.join(RATES)}")
    if all_kinds and not outside:
        raise UserError("--all-kinds", "is for --outside", "add --outside, or give --cases")
    with cli.resumable("the answers are"):
        if outside:
            named = cli.chosen_names(effects, "--effects", (*KINDS, *VOCABULARY_KINDS, Asked.HEALTHY), ())
            count = 0 if all_kinds else OUTSIDE_CASES if cases is None else cases
            plants = tuple(map(str, discrepancy or Discrepancy))
            drawn = OutsidePlan(tier, count, RATES[rate], seed, plants, named)
            _outside(Asking(drawn, workers, out or Path(f"build/discovery-outside-{tier}")), as_json)
            return
        if tier is cli.Tier.A:
            chosen = cli.chosen_names(effects, "--effects", HIDDEN, HIDDEN)
            count = CASES if cases is None else cases
            hiding = HidingPlan(chosen, count, count, RATES[rate], seed)
            _on_nominal_lines(Asking(hiding, workers, out or Path("build/discovery")), as_json)
            return
        plan = _real_plan(cases, healthy, effects, RATES[rate], discrepancy, seed)
        asking = Asking(plan, workers, out or Path("build/discovery-B"))
        if only_record:
            record_only(plan, asking.out)
        else:
            found = run.run_real_lines(asking)
            document = real_tables.json_document(found.results, found.adequate, found.crashes)
            put_out(as_json, document, run.real_shown(found))


def _outside(asking: Asking[OutsidePlan], as_json: bool) -> None:
    found, tier = outside_run.run_outside(asking), asking.plan.tier
    document = outside_tables.json_document(found.results, tier, found.crashes)
    put_out(as_json, document, outside_run.shown(found, tier))


def _on_nominal_lines(asking: Asking[HidingPlan], as_json: bool) -> None:
    found = run.run_discovery(asking)
    cli.tell_figures(save_figures(found.results, asking.out))
    put_out(as_json, tables.json_document(found.results, found.crashes), run.shown(found))


def _real_plan(
    cases: int | None,
    healthy: int | None,
    effects: str,
    rates: tuple[bool, ...],
    discrepancies: list[Discrepancy] | None,
    seed: int,
) -> RealPlan:
    names = tuple(name for name in effects.split(",") if name)
    for name in names:
        try:
            names_of(name)
        except KeyError as error:
            raise UserError("--effects", f"unknown name {error}", "give one, one+other or healthy") from None
    numbers = shared_out(REAL_CASES if cases is None else cases)
    if healthy is not None:
        numbers = replace(numbers, healthy=healthy)
    return RealPlan(numbers, rates, tuple(discrepancies or Discrepancy), seed, names)
