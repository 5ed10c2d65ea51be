"""Inputs of `fit` and `discover`: recordings from files, or evidence that a daemon kept, and the model."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import NOMINAL_INJECTOR, Bench, load_injector
from observer_rt.config.signals import effects_on_one_raster
from observer_rt.daemon.state_file import model_hash
from observer_rt.desk.evaluation.logged import open_source, without_companions
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.discover import DiscoveryTask
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
from observer_rt.identification.likelihood.kept_events import evidence_of_model, read_folder
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.reading import hashes, measured_recordings, without_copies
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters


def measured_files(
    paths: Sequence[Path],
    injector: InjectorParameters,
    decoder: Bench | None,
    from_channels: Sequence[str],
    console: Console,
    most: int = MOST_SAMPLES,
) -> tuple[Measurement, ...]:
    """Recordings of an injector, as `measured_recordings`. decoder: bench that says how logs are read."""
    density = effective_model(injector).coefficients.density
    sources = [open_source(path, decoder, from_channels, console, density=density) for path in paths]
    mounted = None if decoder is None else decoder.injector
    stated = () if mounted is None else effects_on_one_raster(mounted.config.signals, mounted.location)
    return measured_recordings(sources, injector, console, most, stated)


def task_of_recordings(
    recordings: Sequence[Path],
    healthy: Sequence[Path],
    model: Path | None,
    decoder: Bench | None,
    from_channel: Sequence[str],
    console: Console,
) -> tuple[Path, DiscoveryTask]:
    """Injector file (None: the bench's), and recordings to compare with it. Raises `UserError` for unusable files."""
    start = model or (NOMINAL_INJECTOR if decoder is None else decoder.injector.parameters_path)
    injector = load_injector(start)
    paths = without_copies(without_companions(recordings, console), console)
    measured = measured_files([*paths, *without_copies(healthy, console)], injector, decoder, from_channel, console)
    return start, DiscoveryTask(injector, measured[: len(paths)], measured[len(paths) :], hashes(paths))


def task_of_evidence(
    folder: Path, model: Path | None, decoder: Bench | None, console: Console
) -> tuple[Path, DiscoveryTask]:
    """Injector file, and the evidence about it: `model`, else the bench file's, else that of the newest event.

    Raises `UserError` for a folder without evidence, and for an injector file that was changed since.
    """
    named = model or (None if decoder is None else decoder.injector.parameters_path)
    wanted = None if named is None else model_hash(load_injector(named))
    kept = evidence_of_model(read_folder(folder, console), folder, wanted, console)
    start = named or kept.injector_file
    if model_hash(injector := load_injector(start)) != kept.model_sha256:
        remedy = "name a copy with that content by --model, or let the observer see more injections"
        raise UserError(f"--from-evidence {folder}", f"was kept with an earlier content of {start}", remedy)
    return start, DiscoveryTask(injector, (kept.measurement,), (), kept.hashes)
