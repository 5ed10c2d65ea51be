"""`observer-rt export`: what is written where, and the C replayed where there is a compiler."""

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.learned_state import read_state, refuse_missing_state
from observer_rt.desk.export.c_code import c_sources
from observer_rt.desk.export.compiler import compile_c, compiler
from observer_rt.desk.export.document import document_of
from observer_rt.desk.export.fmu import write_fmu
from observer_rt.desk.export.frozen import frozen_of, observer_run, without_its_bus
from observer_rt.desk.export.matlab import RATES, matlab_files
from observer_rt.desk.export.model_description import CONTENTS
from observer_rt.desk.export.reference import (
    ReferenceRun,
    injector_reference,
    observer_reference,
    reference_recording,
)
from observer_rt.engine.service.constants import injector_at
from observer_rt.foundation.console import say
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import check_output, make_folder
from observer_rt.model.parameters import temperature_of

TOLERANCE = {False: 1e-9, True: 2e-3}  # relative, of double and of single precision
"""Largest difference in a column from the reference run; by single precision most in innovations, differences."""
VERSIONS = (2, 3)  # of FMI
NO_LIBRARY = "there is no C compiler here, or FMI has no name for this machine"


@dataclass(frozen=True)
class ExportOptions:
    """What to write; None: not asked for."""

    c: Path | None = None
    fmu: Path | None = None
    matlab: Path | None = None
    json: bool = False
    single: bool = False
    state: Path | None = None
    sample_rate: float | None = None
    fuel_temperature: float | None = None
    """[degC]"""
    force: bool = False


def export_bench(bench: Bench, options: ExportOptions, console: Console) -> None:
    """Write the exports of a bench's one injector. Raises `UserError` for what cannot be carried."""
    folders = {"--c": options.c, "--fmu": options.fmu, "--matlab": options.matlab}
    if not (options.json or any(folders.values())):
        raise UserError("export", "nothing is asked for", "give --c DIR, --fmu DIR, --matlab DIR or --json")
    if options.single and options.c is None:
        raise UserError("--single", "is of the C sources", "add --c DIR, or leave it out")
    bench = without_its_bus(bench, options.sample_rate)
    parameters = bench.injector.parameters
    refuse_missing_state("--state", options.state)
    knowledge = read_state(options.state, parameters, partial(say, console))
    if options.fuel_temperature is not None:
        temperature = temperature_of("--fuel-temperature", options.fuel_temperature)
        bench = bench.with_parameters(injector_at(bench.injector, temperature))
    run = observer_run(bench, knowledge)
    frozen = frozen_of(bench, run)
    sources, functions = c_sources(frozen, options.single), matlab_files(frozen)
    fmus = {f"{name}_fmi{version}.fmu": (name, version) for name in CONTENTS for version in VERSIONS}
    for (option, folder), names in zip(folders.items(), (sources, fmus, functions), strict=True):
        if folder is not None:
            make_folder(option, folder)
            for name in names:
                check_output(option, folder / name, options.force)
    if options.c is not None:
        made = reference_recording(bench)
        runs = {"observer": observer_reference(made, run), "injector": injector_reference(made, frozen)}
        _write(options.c, dict(sources) | dict(reference_files(runs)))
        say(console, f"{options.c}: {len(sources)} C sources, and reference runs of observer and injector")
        _replay(options.c, list(sources), TOLERANCE[options.single], console)
    if options.fmu is not None:
        with file_errors(options.fmu):
            has_library = [write_fmu(options.fmu / name, frozen, *which) for name, which in fmus.items()]
        how = "with a library for this machine" if all(has_library) else f"as sources: {NO_LIBRARY}"
        say(console, f"{options.fmu}: {', '.join(fmus)}, {how}")
    if options.matlab is not None:
        _write(options.matlab, functions)
        missing = "" if RATES in functions else f"; no {RATES}: that is for a lump without [[terms]]"
        say(console, f"{options.matlab}: {', '.join(functions)}{missing}")
    if options.json:
        print(json.dumps(document_of(frozen, parameters), indent=2))


def _replay(folder: Path, sources: Sequence[str], tolerance: float, console: Console) -> None:
    found = compiler()
    if found is None:
        say(console, "there is no C compiler here: the reference runs were not replayed")
        return
    for name, difference in replayed(found, folder, sources, tolerance).items():
        say(console, f"replayed: {name} within {difference} of what runs here")


def replayed(found: str, folder: Path, sources: Sequence[str], tolerance: float) -> Mapping[str, str]:
    """Largest relative difference of the compiled C from the reference runs beside it, by name.

    Raises `RunError` where it exceeds the tolerance.
    """
    differences = {}
    with TemporaryDirectory() as built:
        program = Path(built) / "replay"
        compile_c(found, folder, [name for name in sources if name.endswith(".c")], program)
        for name in CONTENTS:
            files = [str(folder / f"{name}_{kind}.csv") for kind in ("inputs", "outputs")]
            command = [str(program), name, *files, repr(tolerance)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise RunError(
                    f"{folder}: the {name} that was exported differs from ours\n{done.stdout}{done.stderr}"
                )
            differences[name] = done.stdout.split()[-1]
    return differences


def reference_files(runs: Mapping[str, ReferenceRun]) -> Mapping[str, str]:
    """Inputs and outputs of runs as CSV by the names of their files; every number to its last bit."""
    files = {}
    for name, run in runs.items():
        for kind, columns in (("inputs", run.inputs), ("outputs", run.outputs)):
            rows = zip(*(values.tolist() for values in columns.values()), strict=True)
            lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
            files[f"{name}_{kind}.csv"] = "\n".join(lines) + "\n"
    return files


def _write(folder: Path, files: Mapping[str, str]) -> None:
    with file_errors(folder):
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
