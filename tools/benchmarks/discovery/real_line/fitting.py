"""The model `observer-rt fit` makes of a rig's healthy recordings, as its user has it before anything wears."""

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from observer_rt.foundation.errors import RunError
from tools.benchmarks.discovery.answers import OUR_PROGRAM
from tools.benchmarks.discovery.real_line.cases import Rig
from tools.benchmarks.discovery.real_line.generator import RealPlan
from tools.benchmarks.wave_recordings import NEW_PART, maker_file

GENERATOR = "tools.benchmarks.discovery.real_line.generator"
FITTED, HEALTHY, FIT_LOG = "fitted.toml", "healthy", "fit.txt"


def generate(verb: str, sealed: Path, *arguments: str, given: str = "") -> tuple[Path, ...]:
    """Run the generator, the only process that knows what is hidden before the answers are in; the files it wrote."""
    command = [sys.executable, "-m", GENERATOR, verb, str(sealed), *arguments]
    done = subprocess.run(command, input=given, stdout=subprocess.PIPE, text=True, check=True)
    return tuple(Path(line) for line in done.stdout.splitlines())


def seal_cases(plan: RealPlan, sealed: Path) -> None:
    """Have the cases drawn."""
    generate("seal", sealed, given=json.dumps(asdict(plan)))


def fitted_model(rig: Rig, sealed: Path, folder: Path, program: Sequence[str] = OUR_PROGRAM) -> Path:
    """The fitted injector file of a rig in a folder, what it was fitted to beside it; made if it is not there.

    Raises RunError where `fit` fails.
    """
    fitted = folder / FITTED
    if fitted.exists():
        return fitted
    recordings = generate("healthy", sealed, rig.name, str(folder / HEALTHY))
    maker = folder / NEW_PART
    maker.write_text(maker_file())
    command = [*program, "fit", *map(str, recordings), "--model", str(maker), "--output", str(fitted)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    (folder / FIT_LOG).write_text(done.stdout)
    if done.returncode != 0:
        raise RunError(f"observer-rt fit ended with {done.returncode}: {done.stderr.strip()}")
    return fitted
