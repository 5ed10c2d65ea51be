"""The page of one browser: what is watched, drawn some times a second."""

import time
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from bokeh.document import Document
from bokeh.models import InlineStyleSheet
from bokeh.models.widgets import Div
from jinja2 import Template

from observer_rt.watch.injection import SeenInjection
from observer_rt.watch.injector import Seen
from observer_rt.watch.page.banner import injector_html, top_html
from observer_rt.watch.page.controls import Controls
from observer_rt.watch.page.drawing import TOP, Drawing, Parts, Target
from observer_rt.watch.page.history import History
from observer_rt.watch.page.traces import DetailPanels, RatePanel
from observer_rt.watch.watching import Watching

DRAW_EVERY = 33  # ms, if the browser is through with the last drawing
# what nobody follows injection by injection, so that the rate keeps pace where a processor draws
_LETTERS_EVERY, _DETAILS_EVERY, _HISTORY_EVERY = 0.2, 0.5, 1.0  # s
_NARROWEST = 380  # px of a panel before it goes below its neighbour


class Page:
    """Draws what is watched into a document."""

    def __init__(self, document: Document, watching: Watching, folder: Path) -> None:
        """folder: where injections are saved."""
        names = [each.name for each in watching.injectors()]
        self._watching = watching
        self._controls = Controls(names, folder, watching.injectors)
        self._top = _letters(TOP)
        self._banners = [_letters(f"banner_{number}") for number in range(len(names))]
        self._rates = [RatePanel(f"rate_{number}", name) for number, name in enumerate(names)]
        self._details = DetailPanels()
        self._history = History()
        self._begin_anew()
        self._lay_out(document)
        targets: dict[str, Target] = {str(each.name): each for each in (self._top, *self._banners)}
        for panels in self._rates:
            targets |= panels.targets
        targets |= self._details.targets | self._history.targets
        self._drawing = Drawing(document, targets)
        document.add_periodic_callback(self.draw, DRAW_EVERY)

    def draw(self) -> None:
        """What is new since the last drawing, if the browser is through with that."""
        if self._drawing.is_lost:
            self._begin_anew()
        elif self._drawing.is_behind:
            return
        if parts := self._parts():
            self._drawing.send(parts)

    def _begin_anew(self) -> None:
        """Nothing is on the screen."""
        self._said: dict[str, str] = {}
        self._drawn: list[SeenInjection | None] = [None] * len(self._banners)
        self._detailed: SeenInjection | None = None
        self._remembered: SeenInjection | None = None
        self._letters_at = self._details_at = self._history_at = 0.0  # not before

    def _parts(self) -> Parts:
        live, chosen = self._watching.injectors(), self._controls.chosen
        shown = self._controls.shown(live)
        lasts = [injections[-1] if injections else None for injections in shown]
        parts = self._letters_parts(live, lasts)
        for number, last in enumerate(lasts):
            if last is not self._drawn[number]:
                parts |= self._rates[number].parts(shown[number])
        self._drawn = lasts
        now = time.monotonic()
        if lasts[chosen] is not self._detailed and (now >= self._details_at or self._controls.is_held):
            parts |= self._details.parts(shown[chosen])
            self._detailed, self._details_at = lasts[chosen], now + _DETAILS_EVERY
        return parts | self._history_parts(live[chosen].injections)

    def _letters_parts(self, live: Sequence[Seen], lasts: Sequence[SeenInjection | None]) -> Parts:
        """States, faults and numbers that changed."""
        now = time.monotonic()
        if now < self._letters_at and not self._controls.is_held:
            return {}
        said = {TOP: top_html(self._watching)}
        for number, (injector, last) in enumerate(zip(live, lasts, strict=True)):
            said[f"banner_{number}"] = injector_html(injector, last)
        changed: Parts = {name: html for name, html in said.items() if self._said.get(name) != html}
        self._said, self._letters_at = said, now + _LETTERS_EVERY
        return changed

    def _history_parts(self, injections: Sequence[SeenInjection]) -> Parts:
        """All that is kept: it is much."""
        last, now = injections[-1] if injections else None, time.monotonic()
        if last is self._remembered or now < self._history_at or self._controls.is_held:
            return {}
        self._remembered, self._history_at = last, now + _HISTORY_EVERY
        return self._history.parts(injections)

    def _lay_out(self, document: Document) -> None:
        """Every root under the name by which page.html places it."""
        panels = {**self._details.figures, **self._history.figures}
        panels |= {f"rate_{number}": each.figure for number, each in enumerate(self._rates)}
        for name, each in panels.items():
            each.name = name
        for root in (self._top, *self._banners, self._controls.layout, *panels.values()):
            document.add_root(root)
        document.title = "observer_rt"
        document.template = Template(_text("page.html"))
        document.template_variables.update(injectors=len(self._rates), narrowest=_NARROWEST)


def _letters(name: str) -> Div:
    return Div(
        name=name, sizing_mode="stretch_width", stylesheets=[InlineStyleSheet(css=_text("letters.css"))]
    )


def _text(name: str) -> str:
    return files("observer_rt.watch.page").joinpath(name).read_text(encoding="utf-8")
