"""The model `observer-rt fit` makes of a rig's healthy recordings, as its user has it before anything wears."""

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path

from observer_rt.foundation.errors import RunError
from tools.benchmarks.discovery.answers import OUR_PROGRAM
from tools.benchmarks.discovery.real_line.cases import Rig
from tools.benchmarks.discovery.real_line.generator import RealPlan
from tools.benchmarks.discovery.run import BENCHMARKS, PACKAGE
from tools.benchmarks.store import digest_of
from tools.benchmarks.wave_recordings import NEW_PART, maker_file

HERE = Path(__file__).parent
GENERATOR = "tools.benchmarks.discovery.real_line.generator"
FITTED, HEALTHY, FIT_LOG, MADE_BY = "fitted.toml", "healthy", "fit.txt", "made_by.txt"
HIDING_SOURCES = (
    *(
        BENCHMARKS / name
        for name in (
            "plant.py",
            "plant_equations.py",
            "plant_parameters.py",
            "plant_phases.py",
            "sampling.py",
            "wave_line_equations.py",
            "wave_plant.py",
            "wave_plant_equations.py",
            "discovery/answers.py",
            "discovery/cases.py",
            "discovery/generator.py",
        )
    ),
    *(HERE / f"{name}.py" for name in ("rail", "discrepancies", "hidden", "cases", "generator", "fitting")),
)
"""What, with the package, a fitted model and an answer depend on."""


@cache
def state_of_the_code() -> str:
    """Digest of all that a fitted model and an answer depend on."""
    return digest_of((PACKAGE, *HIDING_SOURCES))


def generate(verb: str, sealed: Path, *arguments: str, given: str = "") -> tuple[Path, ...]:
    """Run the generator, the only process that knows what is hidden before the answers are in; the files it wrote."""
    command = [sys.executable, "-m", GENERATOR, verb, str(sealed), *arguments]
    done = subprocess.run(command, input=given, stdout=subprocess.PIPE, text=True, check=True)
    return tuple(Path(line) for line in done.stdout.splitlines())


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
