"""What the view says of the service: state, inputs, links, what was learned and counted."""

import math
from datetime import UTC, datetime

from rich.table import Table
from rich.text import Text

from observer_rt.bus.alignment.timekeeping import LARGEST_DRIFT, MessageTiming
from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.config.signals import Role
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLISECOND, ZERO_CELSIUS
from observer_rt.service.daemon import Daemon
from observer_rt.service.watch.arrivals import age_text
from observer_rt.service.words import REASONS, STATES, is_good

FEW_LINES = 30  # of a terminal, below which inputs that are well share a line
PAUSE = 10 * MILLISECOND  # lateness that is none of a bus


def heading(daemon: Daemon, now: int, width: int) -> Table:
    """State and reasons in words, and the clock."""
    state, reasons = daemon.standing(now)
    line = Text()
    line.append(f" {state.name} ", "bold white on green" if is_good(state) else "bold white on red")
    line.append(f" {STATES[state].what}")
    for reason in reasons:
        line.append(f"\n {reason.name}: {REASONS[reason].what}", "yellow")
    grid = Table.grid(expand=False)
    clock = datetime.now(UTC).astimezone().strftime("%Y-%m-%d %H:%M:%S")
    grid.add_column(width=width - len(clock))
    grid.add_column(width=len(clock), no_wrap=True)
    grid.add_row(line, Text(clock, "bold"))
    return grid


def lines(daemon: Daemon, now: int, height: int) -> list[Text]:
    """Everything else, a line each."""
    return [*_inputs(daemon, now, height), *_links(daemon), *_figures(daemon)]


def _line(text: str, style: str = "dim") -> Text:
    return Text(text, style, no_wrap=True, overflow="ellipsis")


def _inputs(daemon: Daemon, now: int, height: int) -> list[Text]:
    arrivals = daemon.arrivals
    stale = arrivals.stale(now)
    timing = daemon.core.timing
    if height < FEW_LINES and not stale and arrivals.is_complete and not arrivals.is_contested(now):
        oldest = max(arrivals.age_of(role, now) for role in Role)
        return [_line(f" all inputs come, the oldest {age_text(oldest)}{_late(timing)}")]
    told = []
    for source in arrivals.sources:
        late = "" if source in stale else _late([timing[stream] for stream in source.streams])
        text = _line(f" {source.text} ", "bold red" if source in stale else "dim")
        text.append(age_text(arrivals.age(source, now)), "bold red" if source in stale else "")
        told.append(text.append(late, "dim"))
    if arrivals.is_contested(now):
        told.append(_line(f" another node sends our results: {arrivals.foreign_frames} frames", "bold red"))
    return told


def _late(timing: list[MessageTiming] | tuple[MessageTiming, ...]) -> str:
    """How late frames come, and how well the time of their samples is known."""
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


def _links(daemon: Daemon) -> list[Text]:
    told = []
    for port in daemon.ports:
        if isinstance(port.link, IdleLink):
            continue
        condition = str(port.link.condition.state) if port.is_up else "down"
        told.append(
            _line(
                f" {port.label} {condition}, stamps by {port.link.stamp_source}; lost here {port.link.dropped}, "
                f"unsent {port.unsent}, outages {port.troubles}",
                "bold red" if port.is_in_trouble else "dim",
            )
        )
    return told


def _figures(daemon: Daemon) -> list[Text]:
    core = daemon.core
    counters = core.counters
    damaged = counters.crc_errors + counters.length_errors
    told = [
        _line(
            f" {counters.samples} samples, {counters.lost_samples} missing; frames: {damaged} damaged, "
            f"{counters.sequence_errors} out of order, {counters.old_frames} too late"
        )
    ]
    if counters.outliers:
        told.append(_line(f" {counters.outliers}"))
    refused = f"{counters.rejected_adoptions} refused, {counters.late_adoptions} late"
    if counters.passed_over:
        refused += f", {counters.passed_over} events passed over"
    learned = f" learned {counters.adoptions} times in {counters.events} events ({refused})"
    told.append(_line(learned if core.learning else f"{learned}; learning is off"))
    if core.fuel_temperature is not None:
        told[-1].append(f"; fuel {core.fuel_temperature - ZERO_CELSIUS:.1f} °C")
    if core.energizing is not None:
        is_odd = core.energizing.missing > 0 or core.energizing.uncommanded > 0
        told.append(_line(f" {core.energizing.as_text()}", "yellow" if is_odd else "dim"))
    if daemon.failed_writes:
        text = f" {daemon.failed_writes} failed writes of learned state, journal or log, which says why"
        told.append(_line(text, "bold red"))
    return told
