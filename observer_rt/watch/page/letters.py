"""Letters of the page: its head, and the banner of every injector."""

import math
from datetime import datetime

from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.foundation.pages import templates_of
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.words import REASONS, is_good
from observer_rt.watch.injector import Seen
from observer_rt.watch.page.columns import SURE
from observer_rt.watch.results import SeenInjection
from observer_rt.watch.watching import Watching

_LATELY = 100  # injections of which the share of valid ones is told
_BUSY = 0.8  # share of the time from which a bus is hardly able to carry more


def banner_html(seen: Seen, shown: SeenInjection | None) -> str:
    """One injector: state and faults now, and the injection shown."""
    lately = seen.injections[-_LATELY:]
    valid = sum(each.summary.valid == 1.0 for each in lately) / max(1, len(lately))
    kind, state = _state(seen.status)
    return _TEMPLATES.get_template("banner.html").render(
        seen=seen,
        kind="bad" if seen.faults else kind,
        state=state,
        shown=shown,
        validity="" if shown is None else _validity(shown),
        lately=len(lately),
        valid_share=valid,
    )


def top_html(watching: Watching) -> str:
    """The head of the page: time, buses, frames lost before they were heard."""
    return _TEMPLATES.get_template("top.html").render(watching=watching)


def _state(status: StatusValues | None) -> tuple[str, str]:
    """Its colour, a class of page.css, and words."""
    if status is None or math.isnan(status.state):
        return "waiting", "no status yet"
    state, reason = State(int(status.state)), Reason(int(status.reason))
    if is_good(state):
        return ("good" if reason is Reason.NONE or reason is Reason.JUMPED else "waiting"), state.name
    return "bad", f"{state.name}: {reason.name}"


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
