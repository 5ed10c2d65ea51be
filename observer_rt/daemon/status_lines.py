"""Faults of a daemon, and the lines of its status, in words."""

from collections.abc import Iterator, Sequence

from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.config.signals import in_words
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.input_watch import ABOUT_INPUTS, LASTING, REPORTED_AFTER
from observer_rt.daemon.snapshot import Fault, StatusLevel, StatusLine
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import REASONS, STATES, TOPICS, Topic, is_good
from observer_rt.foundation.errors import REMEDY
from observer_rt.foundation.units import NANOSECONDS


def faults_of(daemon: Daemon, now: int, state: State, reasons: Sequence[Reason]) -> list[Fault]:
    """Faults at a monotonic time [ns], one for each cause, the likeliest first."""
    faults = [
        Fault(f"{port.label} is down: {what}", port.down_since, remedy)
        for port in daemon.ports
        for what, _, remedy in (port.down.partition(REMEDY),)
        if what
    ]
    faults += _silence(daemon, now)
    is_explained = bool(faults) and (not reasons or reasons[0] in ABOUT_INPUTS)
    if is_explained or is_good(state) or now - daemon.stands_since < LASTING * NANOSECONDS:
        return faults
    words, name = (REASONS[reasons[0]], reasons[0].name) if reasons else (STATES[state], state.name)
    return [*faults, Fault(f"{name}: {words.what}", daemon.stands_since, words.remedy)]


def _silence(daemon: Daemon, now: int) -> list[Fault]:
    """One fault for all silent messages of buses that are up: they mostly share a device or cable."""
    arrivals = daemon.arrivals
    audible = [source for source in arrivals.sources if daemon.ports[source.layout.bus].is_up]
    ages = {source: arrivals.silence(source, now) for source in audible}
    silent = {source: age for source, age in ages.items() if age > max(REPORTED_AFTER, source.patience)}
    if not silent:
        return []
    texts = tuple(f"{source.text}: no frame for {age:.0f} s" for source, age in silent.items())
    since = now - round(max(silent.values()) * NANOSECONDS)
    remedy = TOPICS[Topic.INPUT].remedy
    if len(texts) == 1:
        return [Fault(texts[0], since, remedy)]
    return [Fault(f"no frame of {len(texts)} messages for {min(silent.values()):.0f} s", since, remedy, texts)]


def link_lines(daemon: Daemon) -> Iterator[StatusLine]:
    """A line for each bus that is used."""
    for port in daemon.ports:
        if not isinstance(port.link, IdleLink):
            condition = str(port.link.condition.state) if port.is_up else "down"
            yield StatusLine(
                f"{port.label} {condition}, stamps by {port.link.stamp_source}; lost here {port.link.dropped}, "
                f"unsent {port.unsent}, outages {port.troubles}",
                StatusLevel.BAD if port.is_in_trouble else StatusLevel.GOOD,
            )


def figure_lines(daemon: Daemon) -> Iterator[StatusLine]:
    """Lines of what was received, learned and written, and under which conditions."""
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
    if counters.unlearned_events:
        refused += f", {counters.unlearned_events} events not learned from in time"
    learned = f"learned {counters.adoptions} times in {counters.events} events ({refused})"
    if not core.optional.learning:
        learned += "; learning is off"
    constants = core.compiled.observer.constants
    yield StatusLine("; ".join((learned, *in_words(constants.surroundings))))
    level = (constants.calibration.as_text(), f"rates at {constants.coefficients.density:.0f} kg/m3")
    is_calibrated = constants.calibration.is_calibrated
    yield StatusLine("; ".join(filter(None, level)), StatusLevel.GOOD if is_calibrated else StatusLevel.WAITING)
    if core.optional.energizing is not None:
        is_odd = core.optional.energizing.missing > 0
        yield StatusLine(core.optional.energizing.as_text(), StatusLevel.WAITING if is_odd else StatusLevel.GOOD)
    if daemon.failed_writes:
        text = f"{daemon.failed_writes} failed writes of learned state, journal or log, which says why"
        yield StatusLine(text, StatusLevel.BAD)
