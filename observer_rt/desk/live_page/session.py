"""One browser's view: it gets updates as fast as it draws, and asks for older curves and for files."""

import json
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import asdict, replace
from typing import Any

from observer_rt.daemon.snapshot import ShownInjection
from observer_rt.desk.live_page.reading import Watching
from observer_rt.desk.live_page.saver import Saver

_AHEAD = 2  # messages: one is on its way while the last one is drawn
_STATUS_EVERY = 0.4  # s
_WITH_CURVES = 8  # injections of a message, the newest: what a browser draws
_VALUES = (
    *("number", "valid", "verdict", "remainder", "mass_mg", "mass_bound_mg"),
    *("rail_pressure_MPa", "density_kg_per_m3"),
    *(f"{name}{end}" for name in ("nozzle_v_H", "seat_v_S") for end in ("", "_ci95_low", "_ci95_high")),
)


def read_button(message: str | bytes) -> tuple[str, int, int] | None:
    """Read a browser's message: a button and its values; None for a message that no page of ours sends."""
    try:
        parsed = json.loads(message)
    except (ValueError, RecursionError):
        return None
    match parsed:
        case [str(button), int(number), int(count)]:
            return button, number, count
    return None


class Session:
    """Sends updates to one browser."""

    def __init__(self, watching: Watching, saver: Saver) -> None:
        self._watching = watching
        self._saver = saver
        self._saving: Future[str] | None = None
        self._answer: dict[str, Any] = {"names": [reader.name for reader in watching.readers]}
        self._asked: dict[tuple[int, int], ShownInjection] = {}  # by injector and count
        self._sent = [0] * len(watching.readers)  # injections
        self._number = self._drawn = 0  # of messages: the last one sent, the last one drawn
        self._due = 0.0  # s

    def take_drawn(self, number: int) -> None:
        """The browser has drawn a message."""
        self._drawn = min(max(number, self._drawn), self._number)

    def take(self, button: str, injector: int, count: int) -> None:
        """A button was pressed. count: of an injection."""
        if injector not in range(len(self._sent)):
            return
        reader = self._watching.readers[injector]
        injection = next((injection for injection in reader.injections(count - 1) if injection.count == count), None)
        self._due = 0.0  # who presses a button waits for nothing
        if button == "save" and injection is None:
            self._answer["notice"] = "there is no injection yet"
        elif button == "save" and injection is not None:
            self._saving = self._saving or self._saver.save(injection, reader.name)
        elif button == "curves" and injection is not None and count <= self._sent[injector]:
            self._asked[injector, count] = injection

    def message(self) -> bytes | None:
        """Changes since the last message; None without changes, or while the browser still draws earlier ones."""
        readers, now = self._watching.readers, time.monotonic()
        if self._saving is not None and self._saving.done():
            self._answer["notice"], self._saving, self._due = self._saving.result(), None, 0.0
        has_news = any(reader.count > sent for reader, sent in zip(readers, self._sent, strict=True))
        if self._number - self._drawn >= _AHEAD or not (has_news or now >= self._due):
            return None
        self._due = now + _STATUS_EVERY
        self._number += 1
        injectors: list[dict[str, Any]] = []
        curves: list[bytes] = []
        for number, reader in enumerate(readers):
            seen, news = reader.seen(), reader.injections(self._sent[number])
            self._sent[number] = news[-1].count if news else self._sent[number]
            asked = [injection for (owner, _), injection in self._asked.items() if owner == number]
            without_curves = (replace(injection, curves={}) for injection in news[:-_WITH_CURVES])
            sent = [*asked, *without_curves, *news[-_WITH_CURVES:]]
            injectors.append({**asdict(seen), "news": [_shown(injection) for injection in sent]})
            curves += [injection.data for injection in sent]
        content = {
            "number": self._number,
            "now": time.time_ns(),
            "buses": [asdict(bus) for bus in self._watching.buses()],
            "injectors": injectors,
            **self._answer,
        }
        self._answer, self._asked = {}, {}
        return pack_message(content, curves)


def _shown(injection: ShownInjection) -> dict[str, Any]:
    values = {name: injection.values.get(name) for name in _VALUES}
    return {**injection.text, "values": values, "nominal": injection.references.get("nominal")}


def pack_message(content: dict[str, Any], curves: Sequence[bytes]) -> bytes:
    """A message: the length of the text, the text as JSON, the values of all curves as float32, little-endian."""
    text = json.dumps(content, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)  # values stand at multiples of their width
    return b"".join([len(text).to_bytes(4, "little"), text, *curves])
