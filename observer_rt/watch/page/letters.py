"""Letters of the page: its head, and the banner of every injector."""

import math
from datetime import datetime

from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.foundation.pages import templates_of
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.watch.arrivals import SECOND
from observer_rt.service.words import REASONS, STATES, is_good
from observer_rt.watch.injector import Seen
from observer_rt.watch.page.columns import SURE
from observer_rt.watch.results import SeenInjection
from observer_rt.watch.watching import Watching

_LATELY = 100  # injections of which the share of valid ones is told
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
        age=_age(age),
        is_old=age > OLD,
    )


def top_html(watching: Watching) -> str:
    """The head of the page: time, buses, frames lost before they were heard."""
    return _TEMPLATES.get_template("top.html").render(watching=watching)


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


def _age(seconds: float) -> str:
    """In whole seconds, or minutes: as often as it changes it is drawn."""
    return f"{seconds:.0f} s ago" if seconds < MINUTE else f"{seconds / MINUTE:.0f} min ago"


def _clock(moment: int) -> str:
    """A moment [ns since 1970] as local time."""
    return datetime.fromtimestamp(moment / 1e9).strftime("%H:%M:%S")


_TEMPLATES = templates_of(__package__)
_TEMPLATES.filters["clock"] = _clock
_TEMPLATES.tests["known"] = math.isfinite
_TEMPLATES.globals |= {"nan": math.nan, "SURE": SURE, "BUSY": _BUSY}
