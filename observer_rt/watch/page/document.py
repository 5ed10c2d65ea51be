"""The page of one browser: what is watched, drawn some times a second."""

from importlib.resources import files
from pathlib import Path

from bokeh.document import Document
from bokeh.models import InlineStyleSheet
from bokeh.models.widgets import Div
from jinja2 import Template

from observer_rt.watch.injection import SeenInjection
from observer_rt.watch.page.banner import injector_html, top_html
from observer_rt.watch.page.controls import Controls
from observer_rt.watch.page.history import History
from observer_rt.watch.page.traces import DetailPanels, RatePanel
from observer_rt.watch.watching import Watching

DRAW_EVERY = 60  # ms: of 30 injections a second two are drawn at a time
_HISTORY_EVERY = 16  # drawings
_NARROWEST = 380  # px of a panel before it goes below its neighbour


class Page:
    """Draws what is watched into a document."""

    def __init__(self, document: Document, watching: Watching, folder: Path) -> None:
        """folder: where injections are saved."""
        names = [each.name for each in watching.injectors()]
        self._watching = watching
        self._controls = Controls(names, folder, watching.injectors)
        self._top = _letters("top")
        self._banners = [_letters(f"banner_{number}") for number in range(len(names))]
        self._rates = [RatePanel(name) for name in names]
        self._details = DetailPanels()
        self._history = History()
        self._drawn: list[SeenInjection | None] = [None] * len(names)
        self._detailed: SeenInjection | None = None
        self._turn = 0
        self._lay_out(document)
        document.add_periodic_callback(self.draw, DRAW_EVERY)
        self.draw()

    def draw(self) -> None:
        """What is new since the last drawing."""
        live, chosen = self._watching.injectors(), self._controls.chosen
        shown = self._controls.shown(live)
        _say(self._top, top_html(self._watching))
        for number, injections in enumerate(shown):
            last = injections[-1] if injections else None
            _say(self._banners[number], injector_html(live[number], last))
            if last is not None and last is not self._drawn[number]:
                self._drawn[number] = last
                self._rates[number].show(injections)
        if self._drawn[chosen] is not None and self._drawn[chosen] is not self._detailed:
            self._detailed = self._drawn[chosen]
            self._details.show(shown[chosen])
        if self._turn % _HISTORY_EVERY == 0 and not self._controls.is_held:
            self._history.show(live[chosen].injections)
        self._turn += 1

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


def _say(place: Div, html: str) -> None:
    """Only what changed is sent."""
    if place.text != html:
        place.text = html


def _text(name: str) -> str:
    return files("observer_rt.watch.page").joinpath(name).read_text(encoding="utf-8")
