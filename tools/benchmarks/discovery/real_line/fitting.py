"""Recordings of rigs and cases, and the model `observer-rt fit` makes of a rig before anything wears."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache, partial
from pathlib import Path

from rich.console import Console

from observer_rt.foundation.errors import RunError
from observer_rt.terminal.console import progress_bar
from tools.benchmarks.discovery import run as nominal
from tools.benchmarks.discovery.answers import OUR_PROGRAM
from tools.benchmarks.discovery.asking import generate as generate_by
from tools.benchmarks.discovery.cases import GIVEN
from tools.benchmarks.discovery.real_line.cases import Rig, hidden_text
from tools.benchmarks.discovery.real_line.generator import RealPlan, opened
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, digest_of
from tools.benchmarks.wave_recordings import NEW_PART, maker_file

HERE = Path(__file__).parent
FITTED, HEALTHY, FIT_LOG, MADE_BY, CASES = "fitted.toml", "healthy", "fit.txt", "made_by.txt", "cases"
HIDING_SOURCES = (
    *nominal.HIDING_SOURCES,
    *(
        BENCHMARKS / f"{name}.py"
        for name in ("sampling", "wave_line_equations", "wave_plant", "wave_plant_equations")
    ),
    *(HERE / f"{name}.py" for name in ("rail", "discrepancies", "hidden", "cases", "generator", "fitting")),
)
"""What, with the package, a fitted model and an answer depend on."""
generate = partial(generate_by, "tools.benchmarks.discovery.real_line.generator")


@cache
def state_of_the_code() -> str:
    """Digest of all that a fitted model and an answer depend on."""
    return digest_of((PACKAGE, *HIDING_SOURCES))


def seal_cases(plan: RealPlan, sealed: Path) -> None:
    """Have the cases drawn."""
    generate("seal", sealed, given=json.dumps(asdict(plan)))


def fitted_model(rig: Rig, sealed: Path, folder: Path, program: Sequence[str] = OUR_PROGRAM) -> Path:
    """The fitted injector file of a rig in a folder, what it was fitted to beside it; made anew if the code changed.

    Raises RunError where `fit` fails.
    """
    fitted, made_by = folder / FITTED, folder / MADE_BY
    state = f"{state_of_the_code()} {rig}"
    if fitted.exists() and made_by.exists() and made_by.read_text() == state:
        return fitted
    recordings = generate("healthy", sealed, rig.name, str(folder / HEALTHY))
    maker = folder / NEW_PART
    maker.write_text(maker_file())
    command = [*program, "fit", *map(str, recordings), "--model", str(maker), "--output", str(fitted)]
    command.append("--force")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    (folder / FIT_LOG).write_text(done.stdout)
    if done.returncode != 0:
        raise RunError(f"observer-rt fit ended with {done.returncode}: {done.stderr.strip()}")
    made_by.write_text(state)
    return fitted


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
