"""Findings about a recording, or a log, that a bench is to read."""

import math
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from observer_rt.bus.mapping.timing import TOLERANCE
from observer_rt.config.bench import Bench
from observer_rt.core.stream.stream import dead_band
from observer_rt.desk.check.findings import WITHOUT_LIFT, Finding, Level, Statement, failed, graded, ruled, warning
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.engine.service.noise import SIGNALS
from observer_rt.engine.signal_survey import implausible
from observer_rt.files.formats import is_log, open_recording
from observer_rt.files.replay.framing import bench_for
from observer_rt.files.signals.doubts import doubts
from observer_rt.files.signals.naming import BY_HEADINGS
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS, first_of
from observer_rt.identification.likelihood.events import lift_noise

_UNITS = {role.value: of[1:] for role, of in SIGNALS.items()}
_UNITS |= {"injection_rate": ("mm3/ms", MM3_PER_MS), "energizing": ("", 1.0)}
_UNITS |= {"chamber_pressure": ("MPa", MEGAPASCAL), "fuel_temperature": ("K", 1.0)}


@ruled("recording")
def recording_findings(bench: Bench, path: Path) -> Iterator[Statement]:
    """Findings about a file of signals, read by the bench's `[recording]` where it is not in our own layout."""
    with file_errors(path):
        if is_log(path):
            raise UserError(str(path), "is a CAN log", "look at it by --log")
        stream = open_recording(path, bench.injector)
    yield from stream.details or (f"{path}: our own layout",)
    parts = [
        f"{stretch.start:.6g} to {stretch.start + (stretch.samples - 1) / stream.sample_rate:.6g} s"
        for stretch in stream.stretches
    ]
    yield f"{stream.samples} samples at {stream.sample_rate:g} Hz: {first_of(parts, 10)}"
    for note in stream.notes:
        if BY_HEADINGS not in note and note not in stream.details:  # which say it
            yield warning(note)
    yield from _ranges(stream)
    if not stream.has_lift:
        yield WITHOUT_LIFT
    for chunk in islice(stream.chunks() if stream.has_lift else (), 1):
        noise = lift_noise(chunk)
        opens, shuts = (level / MICROMETRE for level in dead_band(noise))
        text = f"dead band: the needle counts as open above {opens:.3g} um, as shut below {shuts:.3g} um"
        yield f"{text}; noise of the lift {noise / MICROMETRE:.2g} um"
    for finding in implausible(stream.survey):
        yield failed("recording", finding.error(path, stream.names.get(finding.signal, "")))
    for odd in doubts(stream.survey, bench.injector.parameters.baseline, stream.names):
        yield warning(odd.problem, odd.remedy)
    bench_for(bench, stream)


def _ranges(stream: SignalStream) -> Iterator[Statement]:
    for name, survey in stream.survey.signals.items():
        unit, factor = _UNITS[name]
        if not survey.count:
            yield Finding("recording", Level.ERROR, f"{name}: no value at all")
            continue
        lowest, highest, mean = (f"{value / factor:.4g}" for value in (survey.lowest, survey.highest, survey.mean))
        yield f"{name}: {lowest} to {highest} {unit}, mean {mean} {unit}".replace(" ,", ",").rstrip()


@ruled("log")
def log_findings(bench: Bench, path: Path, from_channels: Sequence[str] = ()) -> Iterator[Statement]:
    """Findings about a log of the bench's buses; from_channels: texts of `--from-channel`."""
    logged = LoggedSignals(bench, path, from_channels)
    counters = logged.counters
    text = (
        f"{logged.path}: {counters.frames} input frames, {counters.samples} samples, "
        f"{counters.lost_samples} lost, {counters.interpolated_samples} interpolated, "
        f"{counters.jumps} pauses of the source"
    )
    yield graded(counters.lost_samples == 0, text + (f"; {counters.outliers}" if counters.outliers else ""))
    odd = {
        "with CRC errors": counters.crc_errors,
        "of wrong length": counters.length_errors,
        "out of sequence": counters.sequence_errors,
        "repeated": counters.repeated_frames,
        "too old": counters.old_frames,
    }
    if any(odd.values()):
        yield warning(f"frames {', '.join(f'{count} {what}' for what, count in odd.items() if count)}")
    for note in logged.notes:
        yield warning(note)
    for finding in implausible(logged.survey):
        yield failed("log", finding.error(logged.path))
    for odd_values in doubts(logged.survey, bench.injector.parameters.baseline):
        yield warning(odd_values.problem, odd_values.remedy)
    for timing in logged.timing:
        is_known = timing.unknown == 0.0 or (timing.jitter.frames > 0 and timing.unknown <= TOLERANCE)
        yield graded(is_known, timing.as_text(), "" if math.isinf(timing.unknown) else "see docs/time.md")
    noise, stated = logged.standstill.noise, bench.injector.config.noise
    if noise is not None:
        yield (
            f"noise at standstill, bench file in brackets: rail pressure {noise.rail_pressure / MEGAPASCAL:.3f} "
            f"({stated.rail_pressure_MPa:g}) MPa, line pressure {noise.line_pressure / MEGAPASCAL:.3f} "
            f"({stated.line_pressure_MPa:g}) MPa, needle lift {noise.needle_lift / MICROMETRE:.2f} "
            f"({stated.needle_lift_um:g}) um"
        )
    for role, slow in logged.slow_noise.items():
        _, unit, size = SIGNALS[role]
        yield f"noise of the {role.value.replace('_', ' ')} is not white: {slow.as_text(unit, size)}"
