"""What is said in large letters: state, last mass, wear, what is wrong and what to do."""

import math
from datetime import datetime
from html import escape

from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.words import REASONS, is_good
from observer_rt.watch.faults import Fault
from observer_rt.watch.injector import Seen
from observer_rt.watch.results import SeenInjection
from observer_rt.watch.watching import Watching

_LATELY = 100  # injections of which the share of valid ones is told
_BUSY = 0.8  # share of the time from which a bus is hardly able to carry more


def injector_html(seen: Seen, shown: SeenInjection | None) -> str:
    """One injector: state, the injection shown, faults."""
    kind, state = _state(seen.status)
    name = f"<span class='name'>{escape(seen.name)}</span>" if seen.name else ""
    parts = [f"<div class='state {kind if not seen.faults else 'bad'}'>{name}{escape(state)}</div>"]
    parts += [_fault(fault) for fault in seen.faults]
    if shown is None:
        parts.append("<div class='none'>no injection yet</div>")
        return "".join(parts)
    said = shown.summary
    lately = seen.injections[-_LATELY:]
    valid = sum(each.summary.valid == 1.0 for each in lately) / len(lately)
    parts.append(f"<div class='mass'>{_plus_minus(said.mass, said.mass_sigma)} <small>mg</small></div>")
    rows = [
        ("injection", f"{said.injection_number:.0f}", _validity(shown)),
        ("rail pressure", f"{said.rail_pressure_at_start:.1f} MPa", ""),
        ("nominal", _known(shown.nominal_mass, ".2f", " mg"), ""),
        ("nozzle flow", _plus_minus(100.0 * said.nozzle_wear, 100.0 * said.nozzle_wear_sigma, "+"), "%"),
        ("seat flow", _plus_minus(100.0 * said.seat_wear, 100.0 * said.seat_wear_sigma, "+"), "%"),
        ("valid lately", f"{100.0 * valid:.0f} %", f"of {len(lately)}"),
        ("frames lost", f"{seen.lost}", ""),
    ]
    cells = "".join(
        f"<tr><th>{label}</th><td>{value} <small>{escape(more)}</small></td></tr>"
        for label, value, more in rows
    )
    parts.append(f"<table>{cells}</table>")
    return "".join(parts)


def top_html(watching: Watching) -> str:
    """The head of the page: time, buses, frames lost before they were heard."""
    parts = [
        f"<b>observer_rt</b> <span>{'live' if watching.is_live else 'log'} {_clock(watching.now)}</span>"
    ]
    for bus in watching.buses():
        kind = "bad" if bus.down else "busy" if bus.load > _BUSY else ""
        text = f"down: {bus.down}" if bus.down else f"{100.0 * bus.load:.0f} % load"
        parts.append(f"<span class='bus {kind}'>{escape(bus.label)} {escape(text)}</span>")
    parts.append(f"<span>{watching.dropped} frames lost here</span>")
    if watching.failure is not None:
        parts.append(f"<span class='bus bad'>listening ended: {escape(str(watching.failure))}</span>")
    return f"<div class='top'>{''.join(parts)}</div>"


def _state(status: StatusValues | None) -> tuple[str, str]:
    if status is None or math.isnan(status.state):
        return "waiting", "no status yet"
    state, reason = State(int(status.state)), Reason(int(status.reason))
    if is_good(state):
        return ("good" if reason is Reason.NONE or reason is Reason.JUMPED else "waiting"), state.name
    return "bad", f"{state.name}: {reason.name}"


def _fault(fault: Fault) -> str:
    what = f"<b>{escape(fault.what)}</b><br>since {_clock(fault.since)}"
    return f"<div class='fault'>{what}<br>to do: {escape(fault.remedy)}</div>"


def _clock(moment: int) -> str:
    """A moment [ns since 1970] as local time."""
    return datetime.fromtimestamp(moment / 1e9).strftime("%H:%M:%S")


def _validity(shown: SeenInjection) -> str:
    if shown.summary.valid == 1.0:
        return "valid"
    reason = Reason(int(shown.summary.reason))
    return f"not valid: {reason.name}, {REASONS[reason].what}"


def _plus_minus(value: float, sigma: float, sign: str = "") -> str:
    if math.isnan(value):
        return "not known"
    return f"{value:{sign}.2f}" + ("" if math.isnan(sigma) else f" <small>± {1.96 * sigma:.2f}</small>")


def _known(value: float, form: str, unit: str) -> str:
    return "not known" if math.isnan(value) else f"{value:{form}}{unit}"
