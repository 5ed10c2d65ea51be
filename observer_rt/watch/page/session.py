"""One browser's view of what is watched: live, or held at an injection that can be stepped from and saved."""

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.foundation.errors import ObserverError
from observer_rt.foundation.files import file_errors, templates_of
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.reports.injection_report import known
from observer_rt.service.watch.arrivals import SECOND
from observer_rt.service.words import REASONS, STATES, is_good
from observer_rt.watch.injector import Seen
from observer_rt.watch.samples import SampleCurves, SeenInjection
from observer_rt.watch.watching import Watching

Columns: TypeAlias = Mapping[str, NDArray[np.floating]]
"""By name, (n,) each, nan: nothing to be drawn; the first is the x of all others, and rises. None: nothing at all."""
SURE = 1.96  # standard deviations of a 95 % interval
_OVERLAID = 8  # injections, the one shown included
_POINTS = 300  # of a curve, at the most: a screen shows no more


def rate_columns(seen: Seen) -> Columns:
    """The rate of the last injection and of those before it, its 95 % band and the nominal one [mm3/ms].

    The band is that of the mass: the rate is as sure as the mass.
    """
    columns = _overlaid(("rate",), ("nominal",), seen)
    if not columns:
        return {}
    said = next(each for each in reversed(seen.injections) if each.curves is not None).summary
    rate = columns["rate"]
    band = np.abs(rate) * (SURE * said.mass_sigma / said.mass if said.mass else np.nan)
    return {**columns, "low": rate - band, "high": rate + band}


def mass_columns(seen: Seen) -> Columns:
    """Masses of all injections by their numbers [mg], valid ones and others, with 95 % intervals."""
    said = _in_order(seen)
    is_valid = said["valid"] == 1.0
    return {
        "number": said["injection_number"],
        "nominal": said["nominal_mass"],
        **_banded("valid", np.where(is_valid, said["mass"], np.nan), said["mass_sigma"]),
        **_banded("refused", np.where(is_valid, np.nan, said["mass"]), said["mass_sigma"]),
    }


def wear_columns(seen: Seen) -> Columns:
    """Wear of nozzle and seat over all injections by their numbers [%], with 95 % intervals."""
    said = _in_order(seen)
    return {
        "number": said["injection_number"],
        **_banded("nozzle", 100.0 * said["nozzle_wear"], 100.0 * said["nozzle_wear_sigma"]),
        **_banded("seat", 100.0 * said["seat_wear"], 100.0 * said["seat_wear_sigma"]),
    }


def _in_order(seen: Seen) -> NDArray[np.void]:
    """What is kept, by numbers that rise: an observer that was started anew counts from 1 again."""
    numbered = seen.history[np.isfinite(seen.history["injection_number"])]
    order = np.argsort(numbered["injection_number"], kind="stable")
    return np.take(numbered, order)


def _banded(name: str, mean: NDArray[np.floating], sigma: NDArray[np.floating]) -> Columns:
    return {name: mean, f"{name}_low": mean - SURE * sigma, f"{name}_high": mean + SURE * sigma}


def _overlaid(overlaid: Sequence[str], shown: Sequence[str], seen: Seen) -> Columns:
    """Time [ms], curves of the last injection, and of those before: `NAME_before_K` is that of K injections ago."""
    drawn = [each.curves for each in seen.injections[-_OVERLAID:] if each.curves is not None]
    if not drawn:
        return {}
    longest = max((each.time for each in drawn), key=len)
    step = -(-longest.size // _POINTS)
    time = longest[::step]

    def thinned(curves: SampleCurves, name: str) -> NDArray[np.float32]:
        values = getattr(curves, name)[::step]
        return np.pad(values, (0, time.size - values.size), constant_values=np.nan)

    *before, last = drawn
    columns = {name: thinned(last, name) for name in (*overlaid, *shown)}
    for ago, curves in enumerate(reversed(before), 1):
        columns |= {f"{name}_before_{ago}": thinned(curves, name) for name in overlaid}
    return {"time": time, **columns}


DETAILS: Mapping[str, Callable[[Seen], Columns]] = {
    "line_pressure": partial(_overlaid, ("line_pressure",), ()),
    "rail_pressure": partial(_overlaid, ("rail_pressure",), ()),
    "needle_lift": partial(_overlaid, ("needle_lift",), ()),
    "phi": partial(_overlaid, (), ("phi_1", "phi_2", "phi_3")),
}
"""What lies behind the rate, by panel: pressures [MPa], lift [um], phi [1/s]."""
HISTORY: Mapping[str, Callable[[Seen], Columns]] = {"mass": mass_columns, "wear": wear_columns}
"""What became of an injector, by panel."""


_LATELY = 100  # injections of which the share of valid ones is shown
OLD = 2.0  # s after which numbers are not those of now
MINUTE = 60.0  # s
_BUSY = 0.8  # share of the time from which a bus is hardly able to carry more


def banner_html(seen: Seen, shown: SeenInjection | None, now: int) -> str:
    """One injector: state and faults now [ns since 1970], and the injection shown, pale once it is old."""
    lately = seen.injections[-_LATELY:]
    valid = sum(each.summary.valid == 1.0 for each in lately) / max(1, len(lately))
    kind, state, words = _state(seen.status)
    age = 0.0 if shown is None else max(0.0, (now - shown.moment) / SECOND)
    return _TEMPLATES.get_template("banner.html").render(
        seen=seen,
        kind="bad" if seen.faults else kind,
        state=state,
        words=words,
        shown=shown,
        validity="" if shown is None else _validity(shown),
        lately=len(lately),
        valid_share=valid,
        # as often as it changes it is drawn
        age=f"{age:.0f} s ago" if age < MINUTE else f"{age / MINUTE:.0f} min ago",
        is_old=age > OLD,
    )


def _state(status: StatusValues | None) -> tuple[str, str, str]:
    """Its colour, a class of page.css, its name, and words."""
    if status is None or math.isnan(status.state):
        return "waiting", "no status yet", "nothing was heard of the observer"
    state, reason = State(int(status.state)), Reason(int(status.reason))
    words = STATES[state].what if reason is Reason.NONE else f"{reason.name}: {REASONS[reason].what}"
    if is_good(state):
        return ("good" if reason in (Reason.NONE, Reason.JUMPED) else "waiting"), state.name, words
    return "bad", state.name, words


def _validity(shown: SeenInjection) -> str:
    if shown.summary.valid == 1.0:
        return "valid"
    reason = Reason(int(shown.summary.reason))
    return f"not valid: {reason.name}, {REASONS[reason].what}"


def _clock(moment: int) -> str:
    """A moment [ns since 1970] as local time."""
    return datetime.fromtimestamp(moment / 1e9).strftime("%H:%M:%S")


_TEMPLATES = templates_of(__package__)
_TEMPLATES.filters["clock"] = _clock
_TEMPLATES.tests["known"] = math.isfinite
_TEMPLATES.globals |= {"nan": math.nan, "SURE": SURE, "BUSY": _BUSY}


_AHEAD = 2  # messages: one is on its way while the last one is drawn
# what nobody follows injection by injection: the rate is drawn with every one, and must not wait for much else
_LETTERS_EVERY, _DETAILS_EVERY, _HISTORY_EVERY = 0.4, 0.45, 1.0  # s


@dataclass
class _Panel:
    """What a panel draws, at the most so often [s]. drawn: up to which injection, due: when again [s]."""

    columns: Callable[[Seen], Columns]
    every: float = 0.0
    drawn: SeenInjection | None = None
    due: float = 0.0


class Session:
    """Follows the buttons of one browser, and sends it what is new: letters, columns, how the buttons stand."""

    def __init__(self, watching: Watching, folder: Path) -> None:
        """folder: where injections are saved."""
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
        self._rates = {f"rate_{number}": _Panel(rate_columns) for number in range(len(self._names))}
        self._slow = {name: _Panel(columns, _DETAILS_EVERY) for name, columns in DETAILS.items()}
        self._slow |= {name: _Panel(columns, _HISTORY_EVERY) for name, columns in HISTORY.items()}

    def take(self, button: str, value: int) -> None:
        """What the browser says: a button that was pressed, or `drawn`, with the number of a message."""
        match button:
            case "drawn":
                self._drawn = value
                return
            case "hold":
                self._hold(self._watching.injectors() if self._held is None else None)
            case "choose":
                self._chosen = range(len(self._names))[value]
                self._hold(self._held)
            case "step" | "place":
                if self._held is None:
                    self._hold(self._watching.injectors())
                self._place = min(max(0, value if button == "place" else self._place + value), self._last)
            case "save":
                self._said = self._save()
        self._letters_due = 0.0  # who presses a button waits for nothing
        for panel in self._slow.values():
            panel.due = 0.0

    def message(self) -> bytes | None:
        """What is new since the last one; None: nothing, or the browser is not through with those before.

        All rates, and one thing more: a browser is not to be busy for long at a time.
        """
        if self._number - self._drawn >= _AHEAD:
            return None
        live = self._watching.injectors()
        shown = self._shown(live)
        said: dict[str, Any] = {}
        if self._controls != (controls := self._buttons()):
            self._controls = said["controls"] = controls
        columns = self._new_rates(shown)
        if letters := self._new_letters(live, shown):
            said["letters"] = letters
        else:
            columns |= self._next_panel(shown[self._chosen])
        if not said and not columns:
            return None
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
        }

    def _new_letters(self, live: Sequence[Seen], shown: Sequence[Seen]) -> dict[str, str]:
        """States, faults and numbers that changed, by the element they stand in."""
        now = time.monotonic()
        if now < self._letters_due:
            return {}
        letters = {"top": _TEMPLATES.get_template("top.html").render(watching=self._watching)}
        for number, (now_seen, then_seen) in enumerate(zip(live, shown, strict=True)):
            letters[f"banner_{number}"] = banner_html(now_seen, _last_of(then_seen), self._watching.now)
        changed = {name: html for name, html in letters.items() if self._letters.get(name) != html}
        self._letters, self._letters_due = letters, now + _LETTERS_EVERY
        return changed

    def _new_rates(self, shown: Sequence[Seen]) -> dict[str, Columns]:
        found: dict[str, Columns] = {}
        for (name, panel), seen in zip(self._rates.items(), shown, strict=True):
            if panel.drawn is not (last := _last_of(seen)):
                panel.drawn, found[name] = last, panel.columns(seen)
        return found

    def _next_panel(self, seen: Seen) -> dict[str, Columns]:
        """Of the other panels the one that is due longest, if there is something new for it."""
        now, last = time.monotonic(), _last_of(seen)
        waiting = [name for name, each in self._slow.items() if each.drawn is not last and now >= each.due]
        if not waiting:
            return {}
        name = min(waiting, key=lambda each: self._slow[each].due)
        panel = self._slow[name]
        panel.drawn, panel.due = last, now + panel.every
        return {name: panel.columns(seen)}

    def _save(self) -> str:
        last = _last_of(self._shown(self._watching.injectors())[self._chosen])
        if last is None:
            return "there is no injection yet"
        try:
            path = save_injection(last, self._folder, self._names[self._chosen])
        except ObserverError as error:
            return str(error)
        return f"saved: {path}, .json"


def _last_of(seen: Seen) -> SeenInjection | None:
    return seen.injections[-1] if seen.injections else None


def packed(said: Mapping[str, Any], columns: Mapping[str, Columns]) -> bytes:
    """A message: the length of the text, the text as JSON, then the values of all columns as float32.

    What is little-endian here is so in browsers. The text also says how long the columns of each panel are.
    """
    lengths = {panel: {name: each.size for name, each in drawn.items()} for panel, drawn in columns.items()}
    text = json.dumps({**said, "columns": lengths}).encode()
    text += b" " * (-len(text) % 4)  # values stand at multiples of their width
    values = [each.astype("<f4").tobytes() for drawn in columns.values() for each in drawn.values()]
    return b"".join([len(text).to_bytes(4, "little"), text, *values])


_HEADER = (
    "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa,"
    "published_rate_mm3_per_ms,nominal_rate_mm3_per_ms,phi1,phi2,phi3"
)


def save_injection(seen: SeenInjection, folder: Path, name: str) -> Path:
    """Write `injection_[NAME_]NUMBER.csv`, and `.json` beside it. Returns the table's path.

    name: of the injector, empty for the only one. Raises `ObserverError` when they cannot be written.
    """
    number = f"{seen.summary.injection_number:.0f}"
    path = folder / f"injection_{f'{name}_' if name else ''}{number}.csv"
    said = seen.summary._asdict() | {"nominal_mass": seen.nominal_mass}
    document = {key: known(value) for key, value in said.items()} | {"moment_ns": seen.moment}
    columns = np.empty((0, _HEADER.count(",") + 1))
    if seen.curves is not None:
        columns = np.column_stack(seen.curves).astype(np.float64)
        columns[:, [0, 2]] *= 1e-3  # ms, um
    with file_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, columns, "%.9g", ",", header=_HEADER, comments="")
        path.with_suffix(".json").write_text(json.dumps(document, indent=2, allow_nan=False))
    return path
