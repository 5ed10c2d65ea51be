"""All that a browser is to draw, in one message at a time; the next one when it has drawn the last.

Bokeh sends every change of a model by itself, with a look at all others: many changes at a time cost the server more
than all the rest of a drawing.
"""

import time
from collections.abc import Mapping
from importlib.resources import files
from typing import TypeAlias

import numpy as np
from bokeh.core.properties import Any, Dict, Int, String
from bokeh.document import Document
from bokeh.model import DataModel
from bokeh.models import ColumnDataSource, CustomJS, Range1d
from bokeh.models.widgets import Div
from numpy.typing import NDArray

Columns: TypeAlias = Mapping[str, NDArray[np.generic]]
Limits: TypeAlias = tuple[float, float]
Parts: TypeAlias = dict[str, str | Columns | Limits]
"""By the name of what they belong to: the text of a `Div`, the columns of a source, both ends of a range."""
Target: TypeAlias = Div | ColumnDataSource | Range1d
TOP = "top"
"""The target that every page has."""
PATIENCE = 1.0  # s for a browser to draw: one that sleeps is told of all anew, now and then


class Message(DataModel):
    """What the browser gets, and says of it."""

    content = Dict(String, Any)  # `number` and `parts` in one property, for each is sent by itself
    drawn = Int(-1)  # number of the last one that was drawn: the browser says it, 0 when it is ready


class Drawing:
    """Brings parts to the browser that has a document open."""

    def __init__(self, document: Document, targets: Mapping[str, Target]) -> None:
        """targets: what the parts belong to, by name."""
        self._number = 0
        self._message = Message(name="drawing", content={"number": 0, "parts": {}})
        self._sent_at = time.monotonic()
        code = files("observer_rt.watch.page").joinpath("drawing.js").read_text(encoding="utf-8")
        draw = CustomJS(args={"message": self._message, "targets": dict(targets)}, code=code)
        self._message.js_on_change("content", draw)
        document.js_on_event("document_ready", draw)
        targets[TOP].tags = [
            self._message
        ]  # so that it is part of the document, of which it is nothing to see

    @property
    def is_behind(self) -> bool:
        """Whether the last parts are not drawn yet."""
        return bool(self._message.drawn != self._number)

    @property
    def is_lost(self) -> bool:
        """Whether they have not been for so long that the browser may never have got them."""
        return self.is_behind and time.monotonic() - self._sent_at > PATIENCE

    def send(self, parts: Parts) -> None:
        """Draw these; what is in none of them stays."""
        self._sent_at = time.monotonic()
        self._number += 1
        self._message.update(content={"number": self._number, "parts": parts})
