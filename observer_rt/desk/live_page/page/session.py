"""One browser's view of what is watched: live, or held at an injection that can be stepped from and saved."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.desk.live_page.injector import Seen
from observer_rt.desk.live_page.page.columns import DETAILS, HISTORY, Columns, Panels, rate_columns
from observer_rt.desk.live_page.page.letters import banner_html, last_of, number_of, numbers_html, top_html
from observer_rt.desk.live_page.samples import SeenInjection
from observer_rt.desk.live_page.watching import Watching
from observer_rt.engine.reports.injection_report import known
from observer_rt.foundation.errors import ObserverError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import replacing, write_text

_AHEAD = 2  # messages: one is on its way while the last one is drawn
# what nobody follows injection by injection: rates and masses come with every one, and must not wait for much else
_LETTERS_EVERY, _DETAILS_EVERY, _HISTORY_EVERY = 0.4, 0.45, 1.0  # s
_HEADER = (
    "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa,"
    "published_rate_mm3_per_ms,nominal_rate_mm3_per_ms,phi1,phi2,phi3"
)


def pressed(message: str | bytes) -> tuple[str, int] | None:
    """Reads a browser's message: a button, and its value; None: it is no page of ours."""
    try:
        said = json.loads(message)
    except (ValueError, RecursionError):
        return None
    match said:
        case [str(button), int(value)]:
            return button, value
    return None


@dataclass
class _Group:
    """Panels that are drawn together, at the most so often [s]. drawn: up to which injection, due: when again [s]."""

    panels: Panels
    every: float = 0.0
    drawn: SeenInjection | None = None
    due: float = 0.0


class Session:
    """Follows the buttons of one browser, and sends it what is new: letters, columns, how the buttons stand."""

    def __init__(self, watching: Watching, folder: Path, asks: bool = False) -> None:
        """folder: where injections are saved; asks: whether there is a page that asks what is missing."""
        self._asks = asks
        self._watching = watching
        self._folder = folder
        self._names = [each.name for each in watching.injectors()]
        self._chosen = 0  # injector whose details are shown
        self._held: tuple[Seen, ...] | None = None
        self._place = 0  # of the injection shown among those held
        self._said = ""
        self._number = self._drawn = 0  # of messages: the last one sent, the last one drawn
        self._controls: dict[str, Any] = {}
        self._letters: dict[str, str] = {}
        self._letters_due = 0.0  # s
        self._drawn_injections: list[SeenInjection | None] = [None] * len(self._names)
        self._slow = [_Group(DETAILS, _DETAILS_EVERY), _Group(HISTORY, _HISTORY_EVERY)]

    def take(self, button: str, value: int) -> None:
        """Take a message of the browser: a button that was pressed, or `drawn`, with the number of a message."""
        match button:
            case "drawn":
                self._drawn = min(max(value, self._drawn), self._number)
                return
            case "hold":
                self._hold(self._watching.injectors() if self._held is None else None)
            case "choose" if value in range(len(self._names)):
                self._chosen = value
                self._hold(self._held)
            case "step" | "place":
                if self._held is None:
                    self._hold(self._watching.injectors())
                self._place = min(max(0, value if button == "place" else self._place + value), self._last)
            case "save":
                self._said = self._save()
        self._letters_due = 0.0  # who presses a button waits for nothing
        for group in self._slow:
            group.due = 0.0

    def message(self) -> bytes | None:
        """Changes since the last message; None: nothing, or the browser is not through with those before.

        All rates with their masses, so that they are of one injection, and one thing more: a browser is not to be
        busy for long at a time.
        """
        if self._number - self._drawn >= _AHEAD:
            return None
        live = self._watching.injectors()
        shown = self._shown(live)
        said: dict[str, Any] = {}
        if self._controls != (controls := self._buttons()):
            self._controls = said["controls"] = controls
        columns, numbers = self._new_injections(shown)
        slow = self._changed(self._slow_letters(live, shown))
        if not slow:
            columns |= self._next_group(shown[self._chosen])
        if letters := self._changed(numbers) | slow:
            said["letters"] = letters
            self._letters |= letters
        if not said and not columns:
            return None
        if columns:
            said["injections"] = list(map(number_of, shown))
        self._number += 1
        return packed({"number": self._number, **said}, columns)

    @property
    def _last(self) -> int:
        """Place of the newest injection held."""
        return 0 if self._held is None else max(0, len(self._held[self._chosen].injections) - 1)

    def _hold(self, held: tuple[Seen, ...] | None) -> None:
        """Stand still at the newest of some injections, or go on."""
        self._held = held
        self._place = self._last

    def _shown(self, live: tuple[Seen, ...]) -> list[Seen]:
        """Every injector with the injections to be shown, the last of them as the one that counts."""
        if self._held is None:
            return list(live)
        shown = list(self._held)
        injections = shown[self._chosen].injections[: self._place + 1]
        shown[self._chosen] = replace(shown[self._chosen], injections=injections)
        return shown

    def _buttons(self) -> dict[str, Any]:
        return {
            "names": self._names,
            "chosen": self._chosen,
            "held": self._held is not None,
            "place": self._place,
            "last": self._last,
            "said": self._said,
            "asks": self._asks,
        }

    def _new_injections(self, shown: Sequence[Seen]) -> tuple[dict[str, Columns], dict[str, str]]:
        """Rates and numbers of injections that are not drawn yet."""
        columns: dict[str, Columns] = {}
        letters: dict[str, str] = {}
        for place, seen in enumerate(shown):
            if self._drawn_injections[place] is not (last := last_of(seen)):
                self._drawn_injections[place] = last
                columns[f"rate_{place}"] = rate_columns(seen)
                letters[f"numbers_{place}"] = numbers_html(seen, self._watching.now)
        return columns, letters

    def _slow_letters(self, live: Sequence[Seen], shown: Sequence[Seen]) -> dict[str, str]:
        """States, faults and ages, by the element they stand in; nothing where none is due."""
        now = time.monotonic()
        if now < self._letters_due:
            return {}
        self._letters_due = now + _LETTERS_EVERY
        watching = self._watching
        letters = {"top": top_html(watching)}
        for place, (seen, then_seen) in enumerate(zip(live, shown, strict=True)):
            letters[f"banner_{place}"] = banner_html(seen, watching.is_over)
            letters[f"numbers_{place}"] = numbers_html(then_seen, watching.now)
        return letters

    def _changed(self, letters: Mapping[str, str]) -> dict[str, str]:
        """Those that are not drawn as they are."""
        return {name: html for name, html in letters.items() if self._letters.get(name) != html}

    def _next_group(self, seen: Seen) -> dict[str, Columns]:
        """Columns of those other panels that are due longest, if there is something new for them."""
        now, last = time.monotonic(), last_of(seen)
        waiting = [each for each in self._slow if each.drawn is not last and now >= each.due]
        if not waiting:
            return {}
        group = min(waiting, key=lambda each: each.due)
        group.drawn, group.due = last, now + group.every
        return {name: columns(seen) for name, columns in group.panels.items()}

    def _save(self) -> str:
        last = last_of(self._shown(self._watching.injectors())[self._chosen])
        if last is None:
            return "there is no injection yet"
        try:
            path = save_injection(last, self._folder, self._names[self._chosen])
        except ObserverError as error:
            return str(error)
        return f"saved: {path}, .json"


def packed(said: Mapping[str, Any], columns: Mapping[str, Columns]) -> bytes:
    """A message: the length of the text, the text as JSON, then the values of all columns as float32.

    What is little-endian here is so in browsers. The text also says how long the columns of each panel are.
    """
    lengths = {panel: {name: each.size for name, each in drawn.items()} for panel, drawn in columns.items()}
    text = json.dumps({**said, "columns": lengths}).encode()
    text += b" " * (-len(text) % 4)  # values stand at multiples of their width
    values = [each.astype("<f4").tobytes() for drawn in columns.values() for each in drawn.values()]
    return b"".join([len(text).to_bytes(4, "little"), text, *values])


def save_injection(seen: SeenInjection, folder: Path, name: str) -> Path:
    """Write `injection_[NAME_]NUMBER[_AGAIN].csv`, a new file, and `.json` beside it. Returns the table's path.

    name: of the injector, empty for the only one. Raises `ObserverError` when they cannot be written.
    """
    stem = f"injection_{f'{name}_' if name else ''}{seen.summary.injection_number:.0f}"
    path, again = folder / f"{stem}.csv", 1
    while path.exists() or path.with_suffix(".json").exists():  # numbers begin anew with each daemon
        again += 1
        path = folder / f"{stem}_{again}.csv"
    said = seen.summary._asdict() | {"nominal_mass": seen.nominal_mass}
    document = {key: known(value) for key, value in said.items()} | {"moment_ns": seen.moment}
    columns = np.empty((0, _HEADER.count(",") + 1))
    if seen.curves is not None:
        columns = np.column_stack(seen.curves).astype(np.float64)
        columns[:, [0, 2]] *= 1e-3  # ms, um
    with file_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            np.savetxt(part, columns, "%.7g", ",", header=_HEADER, comments="")
    write_text(path.with_suffix(".json"), json.dumps(document, indent=2, allow_nan=False))
    return path
