"""The page of one browser: its banner, and panels drawn some times a second."""

import json
import math
import secrets
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from html import escape
from importlib.resources import files
from pathlib import Path

from bokeh.document import Document
from bokeh.models import CustomJS
from jinja2 import Template

from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.words import REASONS, is_good
from observer_rt.watch.injector import Fault, Seen
from observer_rt.watch.page.channel import Drawing, Parts
from observer_rt.watch.page.controls import Controls
from observer_rt.watch.page.history import history_panels
from observer_rt.watch.page.panel import Panel, PanelPart
from observer_rt.watch.page.traces import detail_panels, rate_panel
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


# what nobody follows injection by injection: the rate is drawn with every one, and must not wait for much else
_LETTERS_EVERY, _DETAILS_EVERY, _HISTORY_EVERY = 0.4, 0.45, 1.0  # s
_NO_RATE = 0.1  # s after which what else is new waits for none: every drawing has its price
_NARROWEST = 380  # px of a panel before it goes below its neighbour


@dataclass
class _Slow:
    """A panel that is drawn now and then. drawn: of which injection, due: when again [s]."""

    panel: Panel
    every: float
    drawn: SeenInjection | None = None
    due: float = 0.0


class Page:
    """Draws what is watched into a document."""

    def __init__(self, document: Document, watching: Watching, folder: Path) -> None:
        """folder: where injections are saved."""
        names = [each.name for each in watching.injectors()]
        self._watching = watching
        self._controls = Controls(names, folder, watching.injectors)
        self._rates = [rate_panel(f"rate_{number}", name) for number, name in enumerate(names)]
        self._details, self._history = detail_panels(), history_panels()
        self.drawing = Drawing()
        self.token = secrets.token_urlsafe()
        """Known to the browser that has the document open."""
        self.begin()
        self._lay_out(document, [*self._rates, *self._details, *self._history])

    def begin(self) -> None:
        """Nothing is on the screen."""
        self._said: dict[str, str] = {}
        self._letters_due = self._rate_at = 0.0  # s
        self._drawn: list[SeenInjection | None] = [None] * len(self._rates)
        self._slow_details = [_Slow(panel, _DETAILS_EVERY) for panel in self._details]
        self._slow_history = [_Slow(panel, _HISTORY_EVERY) for panel in self._history]

    def draw(self) -> None:
        """What is new since the last drawing, if the browser is through with that."""
        if self.drawing.is_behind:
            return
        if parts := self._parts():
            self.drawing.send(parts)

    def _parts(self) -> Parts:
        """The rates that are new, and one thing more: a browser is not to be busy for long at a time."""
        live, chosen = self._watching.injectors(), self._controls.chosen
        shown = self._controls.shown(live)
        lasts = [injections[-1] if injections else None for injections in shown]
        parts: dict[str, str | PanelPart] = {}
        for number, last in enumerate(lasts):
            if last is not self._drawn[number]:
                parts |= self._rates[number].part(shown[number])
        self._drawn = lasts
        now = time.monotonic()
        if parts:
            self._rate_at = now
        elif now < self._rate_at + _NO_RATE:
            return {}
        kept = self._controls.kept(live)[chosen].injections
        slow = [(each, shown[chosen]) for each in self._slow_details] + [
            (each, kept) for each in self._slow_history
        ]
        return {**parts, **(self._letters_parts(live, lasts) or self._slow_part(slow))}

    def _letters_parts(self, live: Sequence[Seen], lasts: Sequence[SeenInjection | None]) -> Parts:
        """States, faults and numbers that changed."""
        now = time.monotonic()
        if now < self._letters_due and not self._controls.is_held:
            return {}
        said = {"top": top_html(self._watching)}
        for number, (injector, last) in enumerate(zip(live, lasts, strict=True)):
            said[f"banner_{number}"] = injector_html(injector, last)
        changed = {name: html for name, html in said.items() if self._said.get(name) != html}
        self._said, self._letters_due = said, now + _LETTERS_EVERY
        return changed

    def _slow_part(self, panels: Sequence[tuple[_Slow, Sequence[SeenInjection]]]) -> Parts:
        """Of panels with the injections they are to show, the one that waits longest."""
        now = time.monotonic()
        waiting = [
            (slow, injections)
            for slow, injections in panels
            if injections and injections[-1] is not slow.drawn and (now >= slow.due or self._controls.is_held)
        ]
        if not waiting:
            return {}
        slow, injections = min(waiting, key=lambda each: each[0].due)
        slow.drawn, slow.due = injections[-1], now + slow.every
        return slow.panel.part(injections)

    def _lay_out(self, document: Document, panels: Sequence[Panel]) -> None:
        """Every root under the name by which page.html places it."""
        for root in (self._controls.layout, *(each.figure for each in panels)):
            document.add_root(root)
        marks = {each.name: [asdict(mark) for mark in each.marks] for each in panels}
        begin = CustomJS(
            args={"figures": [each.figure for each in panels]},
            code=f"observerPage.begin(figures, {json.dumps(marks)}, cb_context.index)",
        )
        document.js_on_event("document_ready", begin)
        document.title = "observer_rt"
        document.template = Template(_text("page.html"))
        document.template_variables.update(
            token=self.token,
            injectors=len(self._rates),
            panels={each.name: each for each in panels},
            narrowest=_NARROWEST,
            letters=_text("letters.css"),
            script=_text("page.js"),
        )


def _text(name: str) -> str:
    return files("observer_rt.watch.page").joinpath(name).read_text(encoding="utf-8")
