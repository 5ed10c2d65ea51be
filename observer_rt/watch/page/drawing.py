"""All that a browser is to draw, in one message at a time, and not many before it has drawn them.

Bokeh sends every change of a model by itself, with a look at all others, and every array in frames of its own: many
changes at a time cost the server more than all the rest of a drawing.
"""

import time
from collections.abc import Mapping, Sequence
from typing import Any as Anything
from typing import TypeAlias, cast

import numpy as np
from bokeh.core.properties import Any, Dict, Int, String
from bokeh.document import Document
from bokeh.model import DataModel, Model
from bokeh.models import CustomJS

from observer_rt.watch.page.panel import Panel, PanelPart

Parts: TypeAlias = Mapping[str, str | PanelPart]
"""By name: what stands in an element of the page, as HTML, or what a panel shows."""
PATIENCE = 1.0  # s for a browser to draw: one that sleeps is told of all anew, now and then
_AHEAD = 2  # messages: one is on its way while the last one is drawn


class Message(DataModel):
    """What the browser gets, and says of it."""

    content = Dict(String, Any)  # `_content` in one property, for each is sent by itself
    drawn = Int(-1)  # number of the last one that was drawn: the browser says it, 0 when it is ready


class Drawing:
    """Brings parts to the browser that has a document open."""

    def __init__(self, document: Document, root: Model, panels: Sequence[Panel]) -> None:
        """root: any of the document; panels: that parts may be for."""
        self._number = 0
        self._message = Message(name="drawing", content=_content(0, {}))
        self._sent_at = time.monotonic()
        known = {each.name: each.for_browser() for each in panels}
        draw = CustomJS(
            args={"message": self._message, "panels": known},
            code="observerPage.draw(message, panels, cb_context.index)",  # of page.js
        )
        self._message.js_on_change("content", draw)
        document.js_on_event("document_ready", draw)
        root.tags = [self._message]  # so that it is part of the document, of which it is nothing to see

    @property
    def is_behind(self) -> bool:
        """Whether the browser is not ready for more."""
        drawn = cast("int", self._message.drawn)
        return drawn < 0 or self._number - drawn >= _AHEAD

    @property
    def is_lost(self) -> bool:
        """Whether it has not been for so long that it may never have got the last parts."""
        return self.is_behind and time.monotonic() - self._sent_at > PATIENCE

    def send(self, parts: Parts) -> None:
        """Draw these; what is in none of them stays."""
        self._sent_at = time.monotonic()
        self._number += 1
        self._message.update(content=_content(self._number, parts))


def _content(number: int, parts: Parts) -> dict[str, Anything]:
    """A message: all values in one array, of which each panel has its lengths from its start on."""
    values = [np.empty(0, np.float32)]
    said: dict[str, Anything] = {}
    start = 0
    for name, part in parts.items():
        if isinstance(part, str):
            said[name] = part
            continue
        lengths = {column: each.size for column, each in part.columns.items()}
        said[name] = {"x": part.x, "y": part.y, "lengths": lengths, "start": start}
        values += part.columns.values()
        start += sum(lengths.values())
    return {"number": number, "parts": said, "values": np.concatenate(values)}
