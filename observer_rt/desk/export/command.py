"""`observer-rt export`: what is written where, and the C replayed where there is a compiler."""

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.daemon.persistence.state_file import model_hash, restored_knowledge
from observer_rt.desk.export.c_code import c_sources
from observer_rt.desk.export.compiler import compile_c, compiler
from observer_rt.desk.export.document import document_of
from observer_rt.desk.export.fmu import write_fmu
from observer_rt.desk.export.frozen import Frozen, frozen_of, observer_run, without_its_bus
from observer_rt.desk.export.matlab import RATES, matlab_files
from observer_rt.desk.export.model_description import CONTENTS
from observer_rt.desk.export.reference import ReferenceRun, injector_reference, observer_reference
from observer_rt.foundation.console import refuse_existing, say
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.files import file_errors

TOLERANCE = {False: 1e-9, True: 2e-3}  # relative, of double and of single precision
"""Largest difference in a column from the reference run; by single precision most in innovations, differences."""
VERSIONS = (2, 3)  # of FMI


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
    if options.state is not None and not options.state.exists():
        raise UserError(f"--state {options.state}", "no such file", "correct the path, or leave it out")
    knowledge = restored_knowledge(
        options.state,
        model_hash(parameters),
        parameters.scaling.pressure,
        lambda text: say(console, text),
        set_aside=False,
    )
    run = observer_run(bench, knowledge)
    frozen = frozen_of(bench, run)
    if options.c is not None:
        runs = {"observer": observer_reference(bench, run), "injector": injector_reference(bench, frozen)}
        _export_c(options.c, frozen, runs, options, console)
    if options.fmu is not None:
        _export_fmu(options.fmu, frozen, options.force, console)
    if options.matlab is not None:
        files = matlab_files(frozen)
        _write(options.matlab, "--matlab", files, options.force)
        missing = "" if RATES in files else f"; no {RATES}: that is for a lump without [[terms]]"
        say(console, f"{options.matlab}: {', '.join(files)}{missing}")
    if options.json:
        print(json.dumps(document_of(frozen, parameters), indent=2))


def _export_c(
    folder: Path, frozen: Frozen, runs: Mapping[str, ReferenceRun], options: ExportOptions, console: Console
) -> None:
    sources = c_sources(frozen, options.single)
    files = dict(sources)
    for name, run in runs.items():
        files[f"{name}_inputs.csv"], files[f"{name}_outputs.csv"] = as_csv(run.inputs), as_csv(run.outputs)
    _write(folder, "--c", files, options.force)
    say(console, f"{folder}: {len(sources)} C sources, and reference runs of observer and injector")
    found = compiler()
    if found is None:
        say(console, "there is no C compiler here: the reference runs were not replayed")
        return
    for name, difference in replayed(found, folder, sorted(sources), TOLERANCE[options.single]).items():
        say(console, f"replayed: {name} within {difference} of what runs here")


def replayed(found: str, folder: Path, sources: list[str], tolerance: float) -> Mapping[str, str]:
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


def as_csv(columns: Mapping[str, np.ndarray]) -> str:
    """Columns as text, every number to its last bit."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def _export_fmu(folder: Path, frozen: Frozen, force: bool, console: Console) -> None:
    paths = {
        (name, version): folder / f"{name}_fmi{version}.fmu" for name in CONTENTS for version in VERSIONS
    }
    refuse_existing("--fmu", paths.values(), force)
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        has_library = [write_fmu(path, frozen, *which) for which, path in paths.items()]
    how = "with a library for this machine" if all(has_library) else "as sources: there is no compiler here"
    say(console, f"{folder}: {', '.join(path.name for path in paths.values())}, {how}")


def _write(folder: Path, option: str, files: Mapping[str, str], force: bool) -> None:
    refuse_existing(option, [folder / name for name in files], force)
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
