"""Healthy recordings, fitted models and cases in a folder that stays, for trials: nothing is asked or scored."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from observer_rt.terminal.console import progress_bar
from tools.benchmarks.discovery.answers import OUR_PROGRAM
from tools.benchmarks.discovery.cases import GIVEN
from tools.benchmarks.discovery.real_line.cases import hidden_text
from tools.benchmarks.discovery.real_line.fitting import fitted_model, generate, seal_cases
from tools.benchmarks.discovery.real_line.generator import RealPlan, opened

CASES = "cases"


def record_only(plan: RealPlan, out: Path, console: Console, program: Sequence[str] = OUR_PROGRAM) -> None:
    """Write DIR/<discrepancy>/healthy, DIR/<discrepancy>/fitted.toml, DIR/cases/<label> and DIR/sealed.json.

    What is there already stays. A line for each case says what is in it.
    """
    seal_cases(plan, out)
    cases = opened(out)
    rigs = sorted({case.rig for case in cases}, key=lambda rig: rig.name)
    with progress_bar(console, "recording", float(len(rigs) + len(cases))) as progress:
        for done, rig in enumerate(rigs, start=1):
            fitted_model(rig, out, out / rig.open_name, program)
            progress(float(done))
        for done, case in enumerate(cases, start=len(rigs) + 1):
            folder = out / CASES / case.label
            if len(list(folder.glob("*.csv"))) < len(GIVEN):
                generate("record", out, case.label, str(folder))
            progress(float(done))
    for case in cases:
        console.print(f"{case.label} {case.rig.open_name}: {hidden_text(case.parts)}", highlight=False)
