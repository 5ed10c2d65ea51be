"""The buttons of the page: hold, step back, save, choose the injector."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from bokeh.layouts import row
from bokeh.models import LayoutDOM
from bokeh.models.widgets import Button, Div, RadioButtonGroup, Slider, Toggle

from observer_rt.foundation.errors import ObserverError
from observer_rt.foundation.files import file_errors
from observer_rt.service.reports.injection_report import known
from observer_rt.watch.injector import Seen
from observer_rt.watch.results import SeenInjection

_HEIGHT = 46  # px: for fingers
_HEADER = (
    "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa,"
    "published_rate_mm3_per_ms,nominal_rate_mm3_per_ms,phi1,phi2,phi3"
)


class Controls:
    """What is shown of what is watched: live, or held at an injection that can be stepped from and saved."""

    def __init__(self, names: Sequence[str], folder: Path, now: Callable[[], tuple[Seen, ...]]) -> None:
        """folder: where injections are saved; now: what is watched, when it is to be held."""
        self._names = names
        self._folder = folder
        self._now = now
        self._held: tuple[Seen, ...] | None = None
        self._injector = RadioButtonGroup(
            labels=list(names), active=0, visible=len(names) > 1, height=_HEIGHT, name="injector"
        )
        self._hold = Toggle(label="Hold", button_type="primary", width=110, height=_HEIGHT, name="hold")
        self._back, self._forth, self._save = (
            Button(label=text, width=width, height=_HEIGHT, name=name)
            for text, width, name in (("◀", 60, "back"), ("▶", 60, "forth"), ("Save", 90, "save"))
        )
        self._place = Slider(start=0, end=1, value=0, title="of those kept", visible=False, width=280)
        self._said = Div(name="said", styles={"font-size": "1.15rem", "padding-top": "0.6em"})
        self._hold.on_change("active", self._on_hold)
        self._injector.on_change("active", self._on_injector)
        self._back.on_click(lambda: self._step(-1))
        self._forth.on_click(lambda: self._step(1))
        self._save.on_click(self._on_save)
        parts = (self._injector, self._hold, self._back, self._forth, self._place, self._save, self._said)
        self.layout: LayoutDOM = row(
            *parts, styles={"flex-wrap": "wrap"}, sizing_mode="stretch_width", name="controls"
        )
        """All of it in a row."""

    @property
    def chosen(self) -> int:
        """Number of the injector whose details are shown."""
        return int(self._injector.active or 0)

    def shown(self, live: tuple[Seen, ...]) -> list[Sequence[SeenInjection]]:
        """Of every injector the injections to be shown, the last of them as the one that counts."""
        injections: list[Sequence[SeenInjection]] = [each.injections for each in self.kept(live)]
        if self.is_held:
            injections[self.chosen] = injections[self.chosen][: int(self._place.value) + 1]
        return injections

    def kept(self, live: tuple[Seen, ...]) -> tuple[Seen, ...]:
        """What is to be seen at all: what is live, or was when the page was held."""
        return live if self._held is None else self._held

    @property
    def is_held(self) -> bool:
        """Whether the page stands still."""
        return self._held is not None

    def _on_hold(self, attr: str, old: bool, new: bool) -> None:
        self._held = self._now() if new else None
        self._hold.label = "Go on" if new else "Hold"
        self._to_last()

    def _on_injector(self, attr: str, old: int, new: int) -> None:
        self._to_last()

    def _to_last(self) -> None:
        """To the newest injection of those held."""
        kept = len(self._held[self.chosen].injections) if self._held is not None else 0
        self._place.end = max(1, kept - 1)
        self._place.value = max(0, kept - 1)
        self._place.visible = kept > 1

    def _step(self, by: int) -> None:
        if self._held is None:
            self._hold.active = True  # which calls `_on_hold`
        self._place.value = min(max(0, self._place.value + by), self._place.end)

    def _on_save(self) -> None:
        injections = self.shown(self._now())[self.chosen]
        if not injections:
            self._said.text = "there is no injection yet"
            return
        try:
            path = save_injection(injections[-1], self._folder, self._names[self.chosen])
        except ObserverError as error:
            self._said.text = str(error)
        else:
            self._said.text = f"saved: {path}, .json"


def save_injection(seen: SeenInjection, folder: Path, name: str) -> Path:
    """Write `injection_[NAME_]NUMBER.csv`, and `.json` beside it. Returns the table's path.

    name: of the injector, empty for the only one. Raises `ObserverError` when they cannot be written.
    """
    number = f"{seen.summary.injection_number:.0f}"
    path = folder / f"injection_{f'{name}_' if name else ''}{number}.csv"
    curves = seen.curves
    columns = [
        curves.time.astype(np.float64) * 1e-3,
        curves.rail_pressure,
        curves.needle_lift * 1e-3,
        curves.line_pressure,
        curves.rate,
        curves.nominal,
        *curves.phi,
    ]
    said = seen.summary._asdict() | {"nominal_mass": seen.nominal_mass}
    document = {key: known(value) for key, value in said.items()} | {"moment_ns": seen.moment}
    with file_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=_HEADER, comments="")
        path.with_suffix(".json").write_text(json.dumps(document, indent=2, allow_nan=False))
    return path
