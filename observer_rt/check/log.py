"""What `check` says of a CAN log: what is missing, how regularly the frames came, how much noise there is."""

import math
from collections.abc import Sequence
from pathlib import Path

from observer_rt.bus.alignment.message_timing import MessageTiming
from observer_rt.bus.mapping.timing import TOLERANCE
from observer_rt.check.findings import Finding, Level, failed, graded
from observer_rt.config.bench import Bench
from observer_rt.config.signals import Role
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.evidence.slow_noise import SlowNoise
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.service.core.counters import Counters
from observer_rt.service.core.noise import SIGNALS

_TOPIC = "log"


def log_findings(bench: Bench, path: Path, from_channels: Sequence[str] = ()) -> list[Finding]:
    """Findings about a log of the bench's buses; from_channels: texts of `--from-channel`."""
    try:
        logged = LoggedSignals(bench, path, from_channels)
    except UserError as error:
        return [failed(_TOPIC, error)]
    return [
        _samples(logged),
        *_frames(logged.counters),
        *(Finding(_TOPIC, Level.WARNING, note) for note in logged.notes),
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
    return graded(_TOPIC, counters.lost_samples == 0, text + outliers)


def _frames(counters: Counters) -> list[Finding]:
    odd = {
        "with CRC errors": counters.crc_errors,
        "of wrong length": counters.length_errors,
        "out of sequence": counters.sequence_errors,
        "repeated": counters.repeated_frames,
        "too old": counters.old_frames,
    }
    told = ", ".join(f"{count} {what}" for what, count in odd.items() if count)
    return [Finding(_TOPIC, Level.WARNING, f"frames {told}")] if told else []


def _regularity(timing: MessageTiming) -> Finding:
    is_known = timing.unknown == 0.0 or (timing.jitter.frames > 0 and timing.unknown <= TOLERANCE)
    remedy = "" if math.isinf(timing.unknown) else "see docs/time.md"
    return graded(_TOPIC, is_known, timing.as_text(), remedy)


def _noise(bench: Bench, standstill: Standstill) -> list[Finding]:
    """Beside what the bench file says of it, which counts until as much was seen."""
    if standstill.noise is None:
        return []
    noise, stated = standstill.noise, bench.injector.config.noise
    return [
        Finding(
            _TOPIC,
            Level.OK,
            f"noise at standstill, bench file in brackets: rail pressure {noise.rail_pressure / MEGAPASCAL:.3f} "
            f"({stated.rail_pressure_MPa:g}) MPa, line pressure {noise.line_pressure / MEGAPASCAL:.3f} "
            f"({stated.line_pressure_MPa:g}) MPa, needle lift {noise.needle_lift / MICROMETRE:.2f} "
            f"({stated.needle_lift_um:g}) um",
        )
    ]


def _slow_noise(role: Role, noise: SlowNoise) -> Finding:
    """Beside the white noise of a signal."""
    _, unit, size = SIGNALS[role]
    name = role.value.replace("_", " ")
    return Finding(_TOPIC, Level.OK, f"noise of the {name} is not white: {noise.as_text(unit, size)}")
