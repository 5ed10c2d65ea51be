"""What the page of the missing effect says of one injector."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import floor, log10
from pathlib import Path

from observer_rt.config.bench import Bench
from observer_rt.daemon.snapshot import ShownInjection
from observer_rt.desk.live_page.missing.search import MissingSearch
from observer_rt.desk.model_steps import TakeOver, steps
from observer_rt.foundation.files import templates_of

GAPS = 60  # injections whose gap is drawn
WIDTH, HEIGHT = 900.0, 160.0  # of the drawing
_ROUND = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class GapBar:
    """An injection's gap, as drawn: place and height in the drawing, what the pointer is told."""

    x: float
    height: float
    is_valid: bool
    says: str


@dataclass(frozen=True)
class GapDrawing:
    """Gaps of the last injections: bars, places where the model changed, and what the whole height is [MPa]."""

    bars: tuple[GapBar, ...]
    changes: tuple[float, ...]
    top: float


def gap_drawing(injections: Sequence[ShownInjection]) -> GapDrawing | None:
    """Draw the gaps of the line pressure; None where none is known yet."""
    shown = [one.values for one in injections[-GAPS:] if one.values["gap_MPa"] is not None]
    if not shown:
        return None
    top, step = _round_top(max(one["gap_MPa"] for one in shown)), WIDTH / GAPS
    bars = tuple(
        GapBar(
            place * step,
            HEIGHT * one["gap_MPa"] / top,
            one["valid"],
            f"injection {one['number']}: {one['gap_MPa']:.2f} MPa, {one['model']}",
        )
        for place, one in enumerate(shown)
    )
    changes = tuple(
        (place + 1) * step - 0.1 * step
        for place, (one, after) in enumerate(pairwise(shown))
        if one["model"] != after["model"]
    )
    return GapDrawing(bars, changes, top)


def _round_top(largest: float) -> float:
    """A round number above the largest."""
    power = 10.0 ** floor(log10(max(largest, 1e-3)))
    return next(each * power for each in _ROUND if each * power >= largest)


def panel_html(alone: Bench, injections: Sequence[ShownInjection], search: MissingSearch) -> str:
    """All of it: evidence, the model in force with its steps, the search, the finding, the gaps."""
    injector = alone.injector
    finding = search.finding
    done: Sequence[TakeOver] = [step for step in steps(alone.path) if step.injector == injector.name]
    return _TEMPLATES.get_template("missing.html").render(
        name=injector.name,
        kept=search.kept,
        folder=search.evidence,
        model=injector.parameters_path.name,
        steps=done,
        search=search,
        finding=finding,
        is_in_force=finding is not None and _same(finding.amended, injector.parameters_path),
        drawing=gap_drawing(injections),
        width=WIDTH,
        height=HEIGHT,
        step=WIDTH / GAPS,
    )


def _same(one: Path | None, other: Path) -> bool:
    """Whether two files have the same content."""
    try:
        return one is not None and one.read_bytes() == other.read_bytes()
    except OSError:  # being replaced
        return False


_TEMPLATES = templates_of("observer_rt.desk.live_page")
