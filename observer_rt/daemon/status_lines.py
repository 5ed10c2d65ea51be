"""What a daemon says of itself in lines: how its inputs come, its links, its counts, the noise."""

import math
from collections.abc import Iterator, Sequence

from observer_rt.bus.alignment import LARGEST_DRIFT, MessageTiming
from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.snapshot import InputStatus, StatusLevel, StatusLine
from observer_rt.engine.service.injector import noise_text
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLISECOND, ZERO_CELSIUS

PAUSE = 10 * MILLISECOND  # lateness that is none of a bus
NOISE_EVERY = 5_000_000_000  # ns between two looks at the spectrum of the noise


def inputs_of(daemon: Daemon, now: int) -> tuple[InputStatus, ...]:
    """All input messages at a monotonic time [ns]."""
    arrivals, timing = daemon.arrivals, daemon.core.timing
    stale = arrivals.stale(now)
    inputs = []
    for source in arrivals.sources:
        age, is_stale = arrivals.age(source, now), source in stale
        late = "" if is_stale else lateness([timing[stream] for stream in source.streams])
        known_age = None if math.isnan(age) else age
        inputs.append(InputStatus(source.text, bool(source.streams), known_age, is_stale, late))
    return tuple(inputs)


def lateness(timing: Sequence[MessageTiming]) -> str:
    """Describes how late frames come, and how well the time of their samples is known."""
    if not timing or any(one.jitter.frames == 0 for one in timing):
        return ""
    lately = max(one.lately for one in timing)
    text = f", late by up to {lately / MICROSECOND:.0f} us" if lately < PAUSE else ", comes in bursts"
    drift = max((one.drift for one in timing), key=abs)
    if abs(drift) >= LARGEST_DRIFT:
        text += f", at {1.0 / (1.0 + drift):.3g} times real time"
    unknown = max(one.unknown for one in timing)
    if unknown == math.inf:
        text += ", clocks not known yet"
    elif unknown > 0.0:
        error = max(one.pressure_error for one in timing)
        text += f"; joined by clock, known to {unknown / MICROSECOND:.2g} us ({error / MEGAPASCAL:.2g} MPa)"
    return text


class StatusLines:
    """Lines of a daemon; the noise is looked at every few seconds."""

    def __init__(self) -> None:
        self._noise, self._noise_due = "", 0

    def of(self, daemon: Daemon, now: int) -> Iterator[StatusLine]:
        """Its lines at a monotonic time [ns]."""
        if daemon.arrivals.is_contested(now):
            text = f"another node sends our results: {daemon.arrivals.foreign_frames} frames"
            yield StatusLine(text, StatusLevel.BAD)
        yield from _links(daemon)
        yield from _figures(daemon)
        white = daemon.core.standstill.noise
        if white is None:
            return
        if now >= self._noise_due:
            self._noise, self._noise_due = noise_text(white, daemon.core.slow_noise), now + NOISE_EVERY
        yield StatusLine(f"noise: {self._noise}")


def _links(daemon: Daemon) -> Iterator[StatusLine]:
    for port in daemon.ports:
        if not isinstance(port.link, IdleLink):
            condition = str(port.link.condition.state) if port.is_up else "down"
            yield StatusLine(
                f"{port.label} {condition}, stamps by {port.link.stamp_source}; lost here {port.link.dropped}, "
                f"unsent {port.unsent}, outages {port.troubles}",
                StatusLevel.BAD if port.is_in_trouble else StatusLevel.GOOD,
            )


def _figures(daemon: Daemon) -> Iterator[StatusLine]:
    core = daemon.core
    counters = core.counters
    damaged = counters.crc_errors + counters.length_errors
    yield StatusLine(
        f"{counters.samples} samples, {counters.lost_samples} missing; frames: {damaged} damaged, "
        f"{counters.sequence_errors} out of order, {counters.old_frames} too late"
    )
    if daemon.latency is not None:
        yield StatusLine(daemon.latency.as_text())
    if counters.outliers:
        yield StatusLine(counters.outliers)
    refused = f"{counters.rejected_adoptions} refused, {counters.late_adoptions} late"
    if counters.passed_over:
        refused += f", {counters.passed_over} events passed over"
    learned = f"learned {counters.adoptions} times in {counters.events} events ({refused})"
    if not core.optional.learning:
        learned += "; learning is off"
    if core.optional.fuel_temperature is not None:
        learned += f"; fuel {core.optional.fuel_temperature - ZERO_CELSIUS:.1f} °C"
    yield StatusLine(learned)
    constants = core.compiled.observer.constants
    level = (constants.calibration.as_text(), f"rates at {constants.coefficients.density:.0f} kg/m3")
    is_good = constants.calibration.is_calibrated
    yield StatusLine("; ".join(filter(None, level)), StatusLevel.GOOD if is_good else StatusLevel.WAITING)
    if core.optional.energizing is not None:
        is_odd = core.optional.energizing.missing > 0 or core.optional.energizing.uncommanded > 0
        yield StatusLine(
            core.optional.energizing.as_text(), StatusLevel.WAITING if is_odd else StatusLevel.GOOD
        )
    if daemon.failed_writes:
        text = f"{daemon.failed_writes} failed writes of learned state, journal or log, which says why"
        yield StatusLine(text, StatusLevel.BAD)
