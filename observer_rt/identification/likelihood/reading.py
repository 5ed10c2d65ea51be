"""Recordings read from files; refusals before any work begins, and the judged part in words."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from observer_rt.engine.signal_survey import refuse_implausible
from observer_rt.files.signals.doubts import doubts, refuse_dead, refuse_perforated, refuse_without_lift
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals, Sampled, SignalStream
from observer_rt.foundation.console import progress_bar, say
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.files import file_hash
from observer_rt.foundation.units import first_of
from observer_rt.identification.likelihood.commands import commands_of, with_commanded_lift
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES, measured
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.effect import SizedEffect
from observer_rt.model.parameters import InjectorParameters

_RATE_TOLERANCE = 1e-6  # relative
_ALIKE = "give recordings that have a lift, or only such without one"


def read_measured(
    paths: Sequence[Path],
    read: Callable[[Path], SignalStream],
    injector: InjectorParameters,
    console: Console,
    most: int = MOST_SAMPLES,
    stated: tuple[SizedEffect, ...] = (),
) -> tuple[Measurement, ...]:
    """Recordings, read and looked through.

    read: looks through a file the user named, and refuses a file that is no recording; injector: whose needle answers
    the commands where none of them has a lift; most: samples stored of a recording; stated: delays and lags of its
    channels. Raises `UserError` for recordings that cannot serve, or not together.
    """
    for number, path in enumerate(paths):
        if path.resolve() in {other.resolve() for other in paths[:number]}:
            raise UserError(str(path), "is given twice", "give every recording once")
    sources = [read(path) for path in paths]
    refuse_sample_rates(sources)
    is_answered = not any(source.has_lift for source in sources)
    for source in sources:
        refuse_implausible(source.path, source.survey, source.names)
        if not is_answered:
            refuse_without_lift(source, _ALIKE)
        refuse_dead(source.path, source.survey, source.names)
        refuse_perforated(source.path, source.survey)
        if "chamber_pressure" in source.optional:
            say(console, f"warning: {source.path}: its chamber_pressure is passed over, for that of the model")
        for doubt in doubts(source.survey, injector.baseline, source.names):
            say(console, doubt.as_text(source.path))
    if is_answered:
        say(console, "the needle lift was not recorded: it follows from energizing and the pressures")
        recordings = with_commanded_lift(injector, [source.collected(most) for source in sources])
        sources = [HeldSignals(one) for one in recordings]
    results = []
    for path, source in zip(paths, sources, strict=True):
        with progress_bar(console, f"finding injections in {path.name}", source.grid_samples) as progress:
            measurement = measured(source, progress, most)
        commands = commands_of(measurement.recording) if is_answered else None
        results.append(replace(measurement, stated=stated, commands=commands))
    return tuple(results)


def without_copies(paths: Sequence[Path], console: Console) -> list[Path]:
    """Recordings but for those with the content of one before, which say nothing more; they are named.

    A file that is given twice stays, and is refused as such.
    """
    sizes = []
    for path in paths:
        with file_errors(path):
            sizes.append(path.stat().st_size)
    kept: dict[str, Path] = {}
    result = []
    for path, size in zip(paths, sizes, strict=True):
        first = path
        if sizes.count(size) > 1:  # else it is no copy, and need not be read for that
            with file_errors(path):
                first = kept.setdefault(file_hash(path), path)
        if first is not path and first.resolve() != path.resolve():
            say(console, f"warning: {path} is left out: a copy of {first}")
        else:
            result.append(path)
    return result


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


def coverage(measurement: Measurement) -> str:
    """One line for a recording used as a whole, else several. Pilot, main and post are one injection."""
    recording, injections = measurement.recording, measurement.injections
    judged, left_out = len(measurement.events), injections.left_out
    lines = [
        f"{recording.path or 'recording'}: {injections.samples} samples at {recording.sample_rate:g} Hz, "
        f"{injections.missing or 'none'} missing, {judged} of {injections.complete + len(left_out)} injections judged"
    ]
    if chosen := chosen_words(measurement):
        lines.append(f"  {chosen}")
    for lack in sorted({event.lack for event in left_out}):
        times = [f"{event.time:.4f} s" for event in left_out if event.lack is lack]
        lines.append(f"  left out, {lack}: at {first_of(times)}")
    return "\n".join(lines)


def chosen_words(measurement: Measurement) -> str:
    """Describes how injections were chosen of a recording too long to be judged whole; empty for others."""
    judged, complete = len(measurement.events), measurement.injections.complete
    if judged == complete:
        return ""
    return (
        f"{judged} of {complete} complete injections chosen, spread evenly over each operating point: no more than "
        f"{MOST_SAMPLES} samples of a recording are kept"
    )
