"""The view of several injectors: a line for each, and below it one after another as a whole."""

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from observer_rt.service.view import View

TURN = 5_000_000_000  # ns, for which one injector is shown
_HEADINGS = ("injector", "state", "reason", "no", "mass mg", "95 %", "v_H", "valid?")
_BORDER = 2  # lines: the headings, and one to spare


class Overview:
    """Draws the views of all injectors; `render` may be called from another thread."""

    def __init__(self, views: Sequence[View]) -> None:
        self._views = views

    def render(self, now: int, width: int, height: int) -> RenderableType:
        """All of it at a monotonic time [ns], for a terminal of `width` x `height` characters."""
        shown = now // TURN % len(self._views)
        table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
        for heading in _HEADINGS:
            table.add_column(heading, no_wrap=True)
        for number, view in enumerate(self._views):
            table.add_row(*view.summary(now), style="bold" if number == shown else "")
        whole = self._views[shown].render(now, width, height - len(self._views) - _BORDER)
        return Group(table, Text(), whole)
