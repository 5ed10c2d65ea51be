"""`tools/demo --real`: an injector that no model is of, fitted to healthy recordings, then observed as it wears."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from observer_rt.files.formats import write_recording
from tests.observed_plants import recording_of
from tests.plants.plant import record
from tests.plants.real import Setting, real_injector
from tools.benchmarks.campaign import messages
from tools.benchmarks.fitting import maker_file
from tools.benchmarks.real_injectors import MASSES, real_case, write_healthy

WORN = "nozzle +12 %"


def main(
    size: Annotated[Setting, typer.Option(help="Which injector, of three sizes, whole or not.")] = Setting.HEAVY_DUTY,
    seed: Annotated[int, typer.Option(help="Of what sets it apart from its drawing, and of noise.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder for recordings, models and pictures.")] = Path("real"),
) -> None:
    """Fit a realistic injector to its healthy recordings, and observe it with a nozzle that is worn by 12 %.

    Fuel that stiffens with its pressure, a pilot valve, an orifice, cavitating holes, friction that remembers, pump
    strokes, filters, 14 bits: a plant that shares no code with the observer.
    """
    out.mkdir(parents=True, exist_ok=True)
    messages.print(f"recording an injector ({size}) on the bench: healthy, then worn ...", highlight=False)
    injector = real_injector(size, seed)
    healthy = [file.name for file in write_healthy(size, seed, True, out)]
    outcome = record(real_case(size, WORN, seed, 0))
    measured = replace(recording_of(outcome), injection_rate=outcome.truth.injection_rate)
    write_recording(out / "worn.csv", measured)
    (out / "injector.toml").write_text(maker_file(injector.size.part, injector.size.body))
    fitted = ["--output", "fitted.toml", "--plot", "fit.png", "--force"]
    observer_rt(out, "fit", *healthy, "--model", "injector.toml", "--mass", MASSES, *fitted)
    observer_rt(out, "evaluate", "worn.csv", "--model", "fitted.toml", "--plot", "worn.png", "--force")


def observer_rt(folder: Path, *arguments: str) -> None:
    """Say a command, and run it in a folder. Raises `typer.Exit` with its exit code where it fails."""
    messages.print(f"$ observer-rt {' '.join(arguments)}", style="bold", highlight=False, soft_wrap=True)
    done = subprocess.run([sys.executable, "-m", "observer_rt", *arguments], cwd=folder, check=False)
    if done.returncode:
        raise typer.Exit(done.returncode)


if __name__ == "__main__":
    typer.run(main)
