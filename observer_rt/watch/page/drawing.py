"""All that a browser is to draw, in one message at a time, and not many before it has drawn them."""

import json
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from observer_rt.watch.page.panel import PanelPart

Parts: TypeAlias = Mapping[str, str | PanelPart]
"""By name: what stands in an element of the page, as HTML, or what a panel shows."""
_AHEAD = 2  # messages: one is on its way while the last one is drawn
_BYTES = 4  # of a number


class Drawing:
    """Brings parts to a browser."""

    def __init__(self) -> None:
        self._number = 0
        self._send: Callable[[bytes], None] | None = None
        self.drawn = 0
        """Number of the last message that the browser has drawn."""

    def connect(self, send: Callable[[bytes], None]) -> None:
        """Send to this browser from now on."""
        self._send = send
        self._number = self.drawn = 0

    @property
    def is_behind(self) -> bool:
        """Whether the browser is not ready for more."""
        return self._send is None or self._number - self.drawn >= _AHEAD

    def send(self, parts: Parts) -> None:
        """Draw these; what is in none of them stays."""
        assert self._send is not None
        self._number += 1
        self._send(packed(self._number, parts))


def packed(number: int, parts: Parts) -> bytes:
    """A message: the length of the text, the text as JSON, then the values of all columns as float32.

    What is little-endian here is so in browsers.
    """
    said: dict[str, Any] = {}
    values: list[bytes] = []
    start = 0
    for name, part in parts.items():
        if isinstance(part, str):
            said[name] = part
            continue
        lengths = {column: each.size for column, each in part.columns.items()}
        said[name] = {"x": part.x, "y": part.y, "lengths": lengths, "start": start}
        values += (each.astype("<f4").tobytes() for each in part.columns.values())
        start += sum(lengths.values())
    text = json.dumps({"number": number, "parts": said}).encode()
    text += b" " * (-len(text) % _BYTES)  # values stand at multiples of their width
    return b"".join([np.uint32(len(text)).astype("<u4").tobytes(), text, *values])
