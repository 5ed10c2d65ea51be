"""Models that `observer-rt fit` makes of healthy recordings of the richer plants, kept while the code is the same."""

import math
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from observer_rt.config.bench import NOMINAL_INJECTOR, exact_text
from observer_rt.files.formats import write_recording
from observer_rt.foundation.errors import RunError
from tests.observed_plants import commanded, recording_of
from tests.plants.parameters import Injector
from tests.plants.plant import Bench, record
from tests.plants.wave import new_part
from tests.plants.windows import true_masses
from tools.benchmarks.campaign import messages, state_of_the_code

FITTED, MAKER, MADE_BY = "fitted.toml", "new_part.toml", "made_by.txt"
ANSWERS = (0.26e-3, 0.36e-3, 6e-6)  # s, from a command's edges to the needle's, and their jitter; the file's: .3 ms


def fitted_model(
    folder: Path, recorded: Callable[[Path], Sequence[Path]], more: Sequence[str] = (), maker: str = ""
) -> Path:
    """The injector file that `fit` makes of recordings; maker: text of the file it starts from. Raises RunError."""
    fitted, made_by = folder / FITTED, folder / MADE_BY
    if fitted.exists() and made_by.exists() and made_by.read_text() == state_of_the_code():
        return fitted
    folder.mkdir(parents=True, exist_ok=True)
    messages.print(f"fitting {folder.name} ...", highlight=False)
    (folder / MAKER).write_text(maker or maker_file(new_part()))
    files = recorded(folder)
    options = ["--model", folder / MAKER, "--output", fitted, "--force", *more]
    command = [sys.executable, "-m", "observer_rt", "fit", *files, *options]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise RunError(f"observer-rt fit ended with {done.returncode}: {done.stderr.strip()}")
    made_by.write_text(state_of_the_code())
    return fitted


def maker_file(part: Injector, body: float = 0.0) -> str:
    """The injector file `fit` starts from: the nominal one with the sac of this part; where a body's volume [m3] is
    stated, with its geometry, as a workshop knows it."""
    text = NOMINAL_INJECTOR.read_text(encoding="utf-8") if body else exact_text(NOMINAL_INJECTOR)
    document: Any = tomlkit.parse(text)
    document["nozzle"]["sac_volume"] = part.sac_volume
    if body:
        document["fluid"] |= {"density_line": part.density, "density_nozzle": part.density}
        volumes = {"volume": part.line_volume - body, "end_volume": body}
        bore = math.sqrt(4.0 / math.pi * part.line_area)
        document["line"] |= {"model": "wave", "length": part.line_length, "diameter": bore, **volumes}
        document["seat"] |= {"diameter": part.seat_diameter, "max_lift": part.max_lift}
        nozzle = document["nozzle"]
        nozzle["hole_diameter"] *= math.sqrt(part.nozzle_area / new_part().nozzle_area)
    return tomlkit.dumps(document)


def write_recordings(folder: Path, benches: Mapping[str, Bench], file: Path, sigma: float, lift: bool) -> list[Path]:
    """Recordings by name as CSV files; mean masses for `fit --mass` in a file, wrong by a share of one sigma."""
    rng, rows = np.random.default_rng([bench.seed for bench in benches.values()]), ["recording,mass_mg,sigma_mg"]
    for name, bench in benches.items():
        outcome = record(bench)
        seen = recording_of(outcome) if lift else commanded(bench, outcome, *ANSWERS).without_lift()
        write_recording(folder / f"{name}.csv", seen)
        mass = np.mean(true_masses(outcome, bench)) * 1e6
        rows.append(f"{name}.csv,{mass * rng.normal(1.0, sigma):.5f},{sigma * mass:.5f}")
    file.write_text("\n".join(rows) + "\n")
    return [folder / f"{name}.csv" for name in benches]
