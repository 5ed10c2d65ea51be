"""What `check` says of a recording, or of a CAN log: what is made of it, what is missing, how much noise there is."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from observer_rt.bus.alignment.message_timing import MessageTiming
from observer_rt.bus.mapping.timing import TOLERANCE
from observer_rt.check.findings import Finding, Level, failed, graded
from observer_rt.config.bench import Bench
from observer_rt.config.signals import Role
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.evidence.slow_noise import SlowNoise
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.recording.formats import is_log, open_recording
from observer_rt.recording.replay.framing import bench_for
from observer_rt.recording.signals.plausible import implausible
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.service.core.counters import Counters
from observer_rt.service.core.noise import SIGNALS

_SHOWN = 10  # stretches
_UNITS = {
    "rail_pressure": ("MPa", MEGAPASCAL),
    "needle_lift": ("um", MICROMETRE),
    "line_pressure": ("MPa", MEGAPASCAL),
    "injection_rate": ("mm3/ms", MM3_PER_MS),
}


def recording_findings(bench: Bench, path: Path) -> list[Finding]:
    """Findings about a file of signals, read by the bench's `[recording]` where it is not in our own layout."""
    try:
        with file_errors(path):
            if is_log(path):
                raise UserError(str(path), "is a CAN log", "look at it by --log")
            stream = open_recording(path, bench.injector)
    except UserError as error:
        return [failed("recording", error)]
    findings = [
        Finding("recording", Level.OK, line) for line in stream.details or (f"{path}: our own layout",)
    ]
    findings.append(Finding("recording", Level.OK, _extent(stream)))
    findings += [Finding("recording", Level.WARNING, note) for note in stream.notes]
    findings += _ranges(stream)
    findings += [
        failed("recording", found.error(path, stream.names.get(found.signal, "")))
        for found in implausible(stream.survey)
    ]
    try:
        bench_for(bench, stream)
    except UserError as error:
        findings.append(failed("recording", error))
    return findings


def _extent(stream: SignalStream) -> str:
    parts = [
        f"{stretch.start:.6g} to {stretch.start + (stretch.samples - 1) / stream.sample_rate:.6g} s"
        for stretch in stream.stretches
    ]
    more = f" and {len(parts) - _SHOWN} more" if len(parts) > _SHOWN else ""
    return f"{stream.samples} samples at {stream.sample_rate:g} Hz: {', '.join(parts[:_SHOWN])}{more}"


def _ranges(stream: SignalStream) -> Iterator[Finding]:
    for name, survey in stream.survey.signals.items():
        unit, factor = _UNITS[name]
        if not survey.count:
            yield Finding("recording", Level.ERROR, f"{name}: no value at all")
            continue
        text = (
            f"{name}: {survey.lowest / factor:.4g} to {survey.highest / factor:.4g} {unit}, "
            f"mean {survey.mean / factor:.4g} {unit}"
        )
        yield graded("recording", not survey.missing, text, f"{survey.missing} values missing")


def log_findings(bench: Bench, path: Path, from_channels: Sequence[str] = ()) -> list[Finding]:
    """Findings about a log of the bench's buses; from_channels: texts of `--from-channel`."""
    try:
        logged = LoggedSignals(bench, path, from_channels)
    except UserError as error:
        return [failed("log", error)]
    return [
        _samples(logged),
        *_frames(logged.counters),
        *(Finding("log", Level.WARNING, note) for note in logged.notes),
        *(_regularity(timing) for timing in logged.timing),
        *_noise(bench, logged.standstill),
        *(_slow_noise(role, noise) for role, noise in logged.slow_noise.items()),
    ]


def _samples(logged: LoggedSignals) -> Finding:
    counters = logged.counters
    text = (
        f"{logged.path}: {counters.frames} input frames, {counters.samples} samples, "
        f"{counters.lost_samples} lost, {counters.interpolated_samples} interpolated, "
        f"{counters.jumps} pauses of the source"
    )
    outliers = f"; {counters.outliers}" if counters.outliers else ""
    return graded("log", counters.lost_samples == 0, text + outliers)


def _frames(counters: Counters) -> list[Finding]:
    odd = {
        "with CRC errors": counters.crc_errors,
        "of wrong length": counters.length_errors,
        "out of sequence": counters.sequence_errors,
        "repeated": counters.repeated_frames,
        "too old": counters.old_frames,
    }
    told = ", ".join(f"{count} {what}" for what, count in odd.items() if count)
    return [Finding("log", Level.WARNING, f"frames {told}")] if told else []


def _regularity(timing: MessageTiming) -> Finding:
    is_known = timing.unknown == 0.0 or (timing.jitter.frames > 0 and timing.unknown <= TOLERANCE)
    remedy = "" if math.isinf(timing.unknown) else "see docs/time.md"
    return graded("log", is_known, timing.as_text(), remedy)


def _noise(bench: Bench, standstill: Standstill) -> list[Finding]:
    """Beside what the bench file says of it, which counts until as much was seen."""
    if standstill.noise is None:
        return []
    noise, stated = standstill.noise, bench.injector.config.noise
    text = (
        f"noise at standstill, bench file in brackets: rail pressure {noise.rail_pressure / MEGAPASCAL:.3f} "
        f"({stated.rail_pressure_MPa:g}) MPa, line pressure {noise.line_pressure / MEGAPASCAL:.3f} "
        f"({stated.line_pressure_MPa:g}) MPa, needle lift {noise.needle_lift / MICROMETRE:.2f} "
        f"({stated.needle_lift_um:g}) um"
    )
    return [Finding("log", Level.OK, text)]


def _slow_noise(role: Role, noise: SlowNoise) -> Finding:
    """Beside the white noise of a signal."""
    _, unit, size = SIGNALS[role]
    name = role.value.replace("_", " ")
    return Finding("log", Level.OK, f"noise of the {name} is not white: {noise.as_text(unit, size)}")
