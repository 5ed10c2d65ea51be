"""Models that `observer-rt fit` makes of healthy recordings of the richer plants, kept while the code is the same."""

import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from observer_rt.config.bench import NOMINAL_INJECTOR, exact_text
from observer_rt.files.formats import write_recording
from observer_rt.foundation.errors import RunError
from tests.observed_plants import recording_of
from tests.plants.healthy import healthy_benches
from tests.plants.plant import Bench, Outcome, record
from tests.plants.wave import Variant, new_part
from tools.benchmarks.campaign import messages, state_of_the_code

FITTED, MAKER, MADE_BY = "fitted.toml", "new_part.toml", "made_by.txt"


def fitted_model(folder: Path, recorded: Callable[[Path], Sequence[Path]], more: Sequence[str] = ()) -> Path:
    """The injector file that `fit` makes of recordings, which `recorded` writes into a folder.

    more: options of `fit`. Raises RunError where it fails.
    """
    fitted, made_by = folder / FITTED, folder / MADE_BY
    if fitted.exists() and made_by.exists() and made_by.read_text() == state_of_the_code():
        return fitted
    folder.mkdir(parents=True, exist_ok=True)
    messages.print(f"fitting {folder.name} ...", highlight=False)
    (folder / MAKER).write_text(maker_file())
    files = recorded(folder)
    options = ["--model", folder / MAKER, "--output", fitted, "--force", *more]
    command = [sys.executable, "-m", "observer_rt", "fit", *files, *options]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise RunError(f"observer-rt fit ended with {done.returncode}: {done.stderr.strip()}")
    made_by.write_text(state_of_the_code())
    return fitted


def maker_file() -> str:
    """The injector file `fit` starts from: the nominal one with the sac of this part."""
    lines = exact_text(NOMINAL_INJECTOR).splitlines()
    sac = f"sac_volume = {new_part().sac_volume:g}  # V_S, m3"
    return "\n".join(sac if line.partition("=")[0].strip() == "sac_volume" else line for line in lines) + "\n"


def write_outcomes(folder: Path, outcomes: Mapping[str, Outcome]) -> list[Path]:
    """Recordings by name, as CSV files."""
    files = [folder / f"{name}.csv" for name in outcomes]
    for file, outcome in zip(files, outcomes.values(), strict=True):
        write_recording(file, recording_of(outcome))
    return files


def plain_model(out: Path, seed: int) -> Path:
    """The model of tier B's plain line, of the injector of a seed."""

    def recorded(folder: Path) -> list[Path]:
        benches: Mapping[str, Bench] = healthy_benches(Variant.PLAIN, seed)
        return write_outcomes(folder, {name: record(bench) for name, bench in benches.items()})

    return fitted_model(out / f"fit-{seed}", recorded)
