"""Recordings from files, all that is refused before any work begins."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from observer_rt.evidence.excerpts import MOST_SAMPLES, measured
from observer_rt.evidence.measurement import Measurement
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_hash import file_hash
from observer_rt.model.effect import SizedEffect
from observer_rt.recording.signals.plausible import refuse_implausible
from observer_rt.recording.signals.recording import Recording, Sampled
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.terminal.console import progress_bar

_RATE_TOLERANCE = 1e-6  # relative


def read_measured(
    paths: Sequence[Path],
    read: Callable[[Path], SignalStream],
    console: Console,
    most: int = MOST_SAMPLES,
    stated: tuple[SizedEffect, ...] = (),
) -> tuple[Measurement, ...]:
    """Recordings, read and looked through.

    read: looks through a file the user named, and refuses one that is none; most: samples kept of a recording;
    stated: what is known of its channels.
    Raises `UserError` for recordings that cannot serve, or not together.
    """
    for number, path in enumerate(paths):
        if path.resolve() in {other.resolve() for other in paths[:number]}:
            raise UserError(str(path), "is given twice", "give every recording once")
    sources = [read(path) for path in paths]
    refuse_sample_rates(sources)
    for source in sources:
        refuse_implausible(source.path, source.survey, source.names)
    found = []
    for path, source in zip(paths, sources, strict=True):
        with progress_bar(console, f"finding injections in {path.name}", source.grid_samples) as progress:
            found.append(replace(measured(source, progress, most), stated=stated))
    return tuple(found)


def refuse_sample_rates(recordings: Sequence[Sampled]) -> None:
    """Refuse recordings of different sample rates."""
    first = recordings[0]
    for other in recordings[1:]:
        if abs(other.sample_rate - first.sample_rate) > _RATE_TOLERANCE * first.sample_rate:
            raise UserError(
                str(other.path),
                f"is sampled at {other.sample_rate:g} Hz, {first.path} at {first.sample_rate:g} Hz",
                "give recordings of one sample rate: sort them into several calls, or resample them",
            )


def refuse_rates_missing(recordings: Sequence[Recording]) -> None:
    """Refuse a measured injection rate that some recordings have and others have not."""
    first = recordings[0]
    for other in recordings[1:]:
        if (other.injection_rate is None) != (first.injection_rate is None):
            without = other if other.injection_rate is None else first
            raise UserError(
                str(without.path),
                "has no measured injection rate, other recordings have one",
                "leave the column out of all recordings, or give only those that have it",
            )


def hashes(paths: Sequence[Path]) -> dict[str, str]:
    """SHA-256 of recordings by file name, by path where two have one name."""
    names = Counter(path.name for path in paths)
    return {path.name if names[path.name] == 1 else str(path): file_hash(path) for path in paths}


def shortened(hashes: Mapping[str, str]) -> list[str]:
    """Recordings by name and the first digits of their SHA-256: what a file keeps of where its numbers are from."""
    return [f"{name} sha256 {digest[:12]}" for name, digest in hashes.items()]
