"""What `check` says of a recording: what is made of its columns, time and units."""

from collections.abc import Iterator
from pathlib import Path

from observer_rt.check.findings import Finding, Level, failed
from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS
from observer_rt.recording.formats import is_log, open_recording
from observer_rt.recording.replay.framing import bench_for
from observer_rt.recording.signals.plausible import implausible
from observer_rt.recording.signals.stream import SignalStream

_TOPIC = "recording"
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
        return [failed(_TOPIC, error)]
    findings = [Finding(_TOPIC, Level.OK, line) for line in stream.details or (f"{path}: our own layout",)]
    findings.append(Finding(_TOPIC, Level.OK, _extent(stream)))
    findings += [Finding(_TOPIC, Level.WARNING, note) for note in stream.notes]
    findings += _ranges(stream)
    findings += [
        failed(_TOPIC, found.error(path, stream.names.get(found.signal, "")))
        for found in implausible(stream.survey)
    ]
    try:
        bench_for(bench, stream)
    except UserError as error:
        findings.append(failed(_TOPIC, error))
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
            yield Finding(_TOPIC, Level.ERROR, f"{name}: no value at all")
            continue
        text = (
            f"{name}: {survey.lowest / factor:.4g} to {survey.highest / factor:.4g} {unit}, "
            f"mean {survey.mean / factor:.4g} {unit}"
        )
        if survey.missing:
            yield Finding(_TOPIC, Level.WARNING, f"{text}; {survey.missing} values missing")
        else:
            yield Finding(_TOPIC, Level.OK, text)
