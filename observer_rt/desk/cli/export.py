"""`export`: the observer and its model for other machines."""

from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.desk.cli import options
from observer_rt.desk.cli.options import messages, option


def export(
    c: Annotated[
        Path | None,
        option("--c", "Folder for self-contained C99 with reference runs.", "DIR", show_default=False),
    ] = None,
    fmu: Annotated[
        Path | None,
        option("--fmu", "Folder for FMUs, FMI 2.0 and 3.0, co-simulation.", "DIR", show_default=False),
    ] = None,
    matlab: Annotated[
        Path | None,
        option("--matlab", "Folder for functions of MATLAB or Octave.", "DIR", show_default=False),
    ] = None,
    as_json: options.JsonOption = False,
    single: Annotated[bool, option("--single", "C in single precision.")] = False,
    bench: options.BenchOption = EXAMPLE_BENCH,
    model: options.ModelOption = None,
    state: options.StateOption = None,
    sample_rate: Annotated[
        float | None,
        option("--sample-rate", "Samples a second [Hz] (default: the bench file's).", min=1e3, max=1e6),
    ] = None,
    fuel_temperature: options.FuelTemperatureOption = None,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    force: options.ForceOption = False,
) -> None:
    """Export the observer as it is, and the injector alone: for a controller, a test rig, other programs."""
    from observer_rt.desk.export.command import ExportOptions, export_bench

    asked = ExportOptions(
        c=c,
        fmu=fmu,
        matlab=matlab,
        json=as_json,
        single=single,
        state=state,
        sample_rate=sample_rate,
        fuel_temperature=fuel_temperature,
        force=force,
    )
    export_bench(load_bench(bench, model, lenient, off_bus=True).of(injector), asked, messages)
