"""Recordings looked through and measured, or refused; a lift that was not recorded follows from commands."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from observer_rt.core.model.needle import CORNER_ROUNDING, NeedleStroke, lift_of_stroke, stroke_of
from observer_rt.engine.signal_survey import refuse_implausible
from observer_rt.files.signals.doubts import doubts, refuse_dead, refuse_perforated, refuse_without_lift
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals, Sampled, SignalStream
from observer_rt.foundation.console import progress_bar, say
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.files import file_hash
from observer_rt.foundation.units import Floats, first_of
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES, measured
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model
from observer_rt.model.hydraulics import CONTROL_REFERENCE
from observer_rt.model.parameters import InjectorParameters

_SAMPLE_RATE_TOLERANCE = 1e-6  # relative
_LIFT_REMEDY = "give recordings that have a lift, or only such without one"
COMMAND_DELAY = 0.5  # samples, on average, by which a command shows


def measured_recordings(
    sources: Sequence[SignalStream],
    injector: InjectorParameters,
    console: Console,
    most: int = MOST_SAMPLES,
    stated: tuple[SizedEffect, ...] = (),
) -> tuple[Measurement, ...]:
    """Recordings with their noise and events, in the order given; doubts about them are printed.

    injector: answers the commands where no recording has a lift; most: samples stored of each; stated: delays and
    lags of the channels. Raises `UserError` for recordings that cannot serve, or not together.
    """
    paths = [source.path for source in sources if source.path is not None]
    for number, path in enumerate(paths):
        if path.resolve() in {other.resolve() for other in paths[:number]}:
            raise UserError(str(path), "is given twice", "give every recording once")
    refuse_sample_rates(sources)
    is_answered = not any(source.has_lift for source in sources)
    for source in sources:
        _look_through(source, injector, console, is_answered)
    if is_answered:
        say(console, "the needle lift was not recorded: it follows from energizing and the pressures")
        recordings = with_commanded_lift(injector, [source.collected(most) for source in sources])
        sources = [HeldSignals(recording) for recording in recordings]
    results = []
    for source in sources:
        name = "the recording" if source.path is None else source.path.name
        with progress_bar(console, f"finding injections in {name}", source.grid_samples) as progress:
            measurement = measured(source, progress, most)
        commands = commands_of(measurement.recording) if is_answered else None
        results.append(replace(measurement, stated=stated, commands=commands))
    return tuple(results)


def _look_through(source: SignalStream, injector: InjectorParameters, console: Console, is_answered: bool) -> None:
    """Refuse a recording that cannot serve, and print doubts. is_answered: its lift follows from commands."""
    refuse_implausible(source.path, source.survey, source.names)
    if not is_answered:
        refuse_without_lift(source, _LIFT_REMEDY)
    refuse_dead(source.path, source.survey, source.names)
    refuse_perforated(source.path, source.survey)
    if "chamber_pressure" in source.optional:
        say(console, f"warning: {source.path}: its chamber_pressure is passed over, for that of the model")
    for doubt in doubts(source.survey, injector.baseline, source.names):
        say(console, doubt.as_text(source.path))


def refuse_sample_rates(recordings: Sequence[Sampled]) -> None:
    """Raise `UserError` for recordings of different sample rates."""
    first = recordings[0]
    for other in recordings[1:]:
        if abs(other.sample_rate - first.sample_rate) > _SAMPLE_RATE_TOLERANCE * first.sample_rate:
            problem = f"is sampled at {other.sample_rate:g} Hz, {first.path} at {first.sample_rate:g} Hz"
            remedy = "give recordings of one sample rate: sort them into several calls, or resample them"
            raise UserError(str(other.path), problem, remedy)


def refuse_rates_missing(recordings: Sequence[Recording]) -> None:
    """Raise `UserError` for a measured injection rate that some recordings have and others lack."""
    first = recordings[0]
    for other in recordings[1:]:
        if (other.injection_rate is None) != (first.injection_rate is None):
            without = other if other.injection_rate is None else first
            remedy = "leave the column out of all recordings, or give only those that have it"
            raise UserError(str(without.path), "has no measured injection rate, other recordings have one", remedy)


def coverage(measurement: Measurement) -> str:
    """Lines on the samples and injections of a recording; pilot, main and post are one injection."""
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
    """How injections were chosen from a recording too long to be judged whole; empty for others."""
    judged, complete = len(measurement.events), measurement.injections.complete
    if judged == complete:
        return ""
    return (
        f"{judged} of {complete} complete injections chosen, spread evenly over each operating point: no more than "
        f"{MOST_SAMPLES} samples of a recording are kept"
    )


def commands_of(recording: Recording) -> Floats:
    """Starts and ends of energizing (k, 2), in samples: half a sample before the first that shows them."""
    is_on = np.asarray(recording.arrays["energizing"] > 0.5)
    edges = np.flatnonzero(np.diff(is_on, prepend=False, append=False)).astype(np.float64)
    return np.asarray(edges.reshape(-1, 2) - COMMAND_DELAY)


def with_commanded_lift(injector: InjectorParameters, recordings: Sequence[Recording]) -> list[Recording]:
    """Recordings with the lift by which a needle answers their commands. Raises `UserError` if it answers none."""
    results = [commanded_lift(injector, one, commands_of(one)) for one in recordings]
    if not any(one.needle_lift.any() for one in results):
        problem = "no command is answered by the injector file's needle"
        remedy = "check `energizing`, and the delays in [needle] of the injector file"
        raise UserError(str(recordings[0].path or "recording"), problem, remedy)
    return results


def commanded_lift(injector: InjectorParameters, recording: Recording, commands: Floats) -> Recording:
    """A recording with the lift by which an injector's needle would answer commands (k, 2) [samples]."""
    lift, rate = np.zeros(recording.samples), recording.sample_rate
    needle = effective_model(injector).injector.needle_law
    rail_pressures = recording.rail_pressure[commands[:, 0].astype(np.int64)]
    pressures = np.nan_to_num(rail_pressures, nan=CONTROL_REFERENCE) / CONTROL_REFERENCE
    for (start, end), pressure in zip(commands / rate, pressures, strict=True):
        answer = stroke_of(start, end - start, pressure, needle)
        if answer is None:
            continue
        stroke = NeedleStroke(**answer)
        first = (stroke.opening - CORNER_ROUNDING) * rate
        last = (stroke.landed + CORNER_ROUNDING) * rate
        for sample in range(max(int(first), 0), min(int(last), lift.size)):
            lift[sample] = lift_of_stroke(sample / rate, stroke)
    return replace(recording, needle_lift=lift)


def without_copies(paths: Sequence[Path], console: Console) -> list[Path]:
    """Recordings without copies of earlier ones, which are named; a file given twice stays, and is refused later."""
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
        if first.resolve() != path.resolve():
            say(console, f"warning: {path} is left out: a copy of {first}")
        else:
            result.append(path)
    return result


def hashes(paths: Sequence[Path]) -> dict[str, str]:
    """SHA-256 of recordings by file name, by path where two have one name."""
    names = Counter(path.name for path in paths)
    return {path.name if names[path.name] == 1 else str(path): file_hash(path) for path in paths}


def shortened(hashes: Mapping[str, str]) -> list[str]:
    """Recordings by name and the first digits of their SHA-256, as files state where their numbers are from."""
    return [f"{name} sha256 {digest[:12]}" for name, digest in hashes.items()]
