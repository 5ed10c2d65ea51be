"""`tools/bench discovery`: whether `discover`, without a hint, names effects hidden in recordings of other plants."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.foundation.errors import UserError
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Row, conclude, run_cases, table, values_of
from tools.benchmarks.discovery import cases as campaigns
from tools.benchmarks.discovery import nominal, outside, real_line
from tools.benchmarks.discovery.answers import calibration
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.discovery.laws import ALL_KINDS
from tools.benchmarks.discovery.rigs import Rig
from tools.benchmarks.discovery.vocabulary import ALL_EFFECTS, HIDDEN

RATES = {"without": (False,), "with": (True,), "both": (False, True)}


@cli.app.command(
    epilog="Examples: tools/bench discovery --cases 40 --effects lift_offset,seat_area --rate without; "
    "tools/bench discovery --tier B --cases 20 --discrepancy taper; tools/bench discovery --tier C; "
    "tools/bench discovery --outside --cases 0"
)
def discovery(
    cases: Annotated[
        int | None,
        typer.Option(
            min=0,
            help=f"Faulty cases, and as many healthy ones ({nominal.CASES}); in tier B of all kinds "
            f"({real_line.CASES}), in C of each (1); outside of all ({outside.CASES}; 0: each with each --rate).",
        ),
    ] = None,
    effects: Annotated[
        str, typer.Option(help="Hidden effects, by commas (default: all); tier B: also a+b, healthy, or an asking.")
    ] = "",
    rate: Annotated[str, typer.Option(help="Measured rate: without, with or both; tier C: without.")] = "both",
    tier: cli.AnyTierOption = cli.AnyTier.A,
    healthy: Annotated[int | None, typer.Option(min=0, help="Tier B: so many healthy (default: a fifth).")] = None,
    discrepancy: Annotated[list[Discrepancy] | None, typer.Option(help="Tier B; repeatable (default: all).")] = None,
    is_outside: Annotated[
        bool, typer.Option("--outside", help="Instead: what no vocabulary has, and what is proposed for it.")
    ] = False,
    seed: cli.SeedOption = 1,
    jobs: cli.JobsOption = cli.JOBS,
    out: cli.OutOption = None,
) -> None:
    """Whether `discover` names effects hidden in recordings of independent plants."""
    if rate not in RATES:
        raise UserError("--rate", f"is '{rate}'", f"give {', '.join(RATES)}")
    if is_outside and tier is cli.AnyTier.C:
        raise UserError("--outside", "has no tier C", "leave one out: --tier C hides laws as well")
    plants, rates = tuple(discrepancy or Discrepancy), RATES[rate]
    out = out or Path(f"build/discovery{'-outside' if is_outside else ''}-{tier}")
    if is_outside:
        named = cli.chosen_names(effects, "--effects", (*ALL_KINDS, *campaigns.OUTSIDE_SHARES), ())
        count = outside.CASES if cases is None else cases
        hidden = campaigns.outside_cases(str(tier), count, rates, plants, seed, named)
        frame = _run(outside.score_outside, hidden, jobs, out)
        tables = {
            f"asked: {asked}": table(frame[frame["asked"].eq(asked)], "hidden", outside.COLUMNS)
            for asked in campaigns.OUTSIDE_SHARES
            if "asked" in frame and frame["asked"].eq(asked).any()
        }
        bars, misses = outside.bars(str(tier)), outside.misses(frame)
    elif tier is not cli.AnyTier.A:
        is_servo = tier is cli.AnyTier.C
        choices = (*(campaigns.SERVO_HIDDEN if is_servo else ALL_EFFECTS), campaigns.HEALTHY)
        cli.chosen_names(effects.replace("+", ","), "--effects", choices, ())
        names = [name for name in effects.split(",") if name]
        if is_servo:
            hidden, bars = campaigns.servo_cases(cases or 1, seed, names), real_line.SERVO_BARS
        else:
            count = real_line.CASES if cases is None else cases
            hidden, bars = campaigns.real_cases(count, healthy, rates, plants, seed, names), real_line.BARS
        frame = _run(real_line.score_real, hidden, jobs, out)
        tables = {
            "effects, alone, in pairs and without a name": table(frame, "hidden", real_line.COLUMNS),
            "plants": table(frame, "discrepancy", real_line.PLANT_COLUMNS),
        }
        misses = real_line.misses(frame)
    else:
        chosen = cli.chosen_names(effects, "--effects", HIDDEN, HIDDEN)
        hidden = campaigns.nominal_cases(chosen, nominal.CASES if cases is None else cases, rates, seed)
        frame = _run(nominal.score_nominal, hidden, jobs, out)
        tables = {
            "hidden effects": table(frame, "hidden", nominal.COLUMNS),
            "with a measured rate": table(frame, "with_rate", nominal.COLUMNS),
        }
        bars, misses = nominal.BARS, nominal.misses(frame)
    conclude(frame, bars, tables | {"confidence": calibration(values_of(frame, "confidences"))}, out, misses)


def _run(work: Callable[..., Row], cases: Sequence[campaigns.HiddenCase], jobs: int, out: Path) -> pd.DataFrame:
    """A row a case, each asked with the fitted model of its rig, or the nominal one."""
    rigs = dict.fromkeys(case.rig for case in cases if case.rig is not None)
    models: dict[Rig | None, Path | str] = {None: NOMINAL_INJECTOR}
    models |= {rig: real_line.model_of(rig, out) for rig in rigs}
    return run_cases("discovery", work, {case.label: (case, models[case.rig]) for case in cases}, jobs, out)
