"""Words and numbers of the page: the buses, and of each injector its state, its faults, an injection."""

import math
from datetime import datetime

from observer_rt.daemon.input_monitoring.arrivals import SECOND
from observer_rt.desk.live_page.injector import Seen
from observer_rt.desk.live_page.page.columns import SURE
from observer_rt.desk.live_page.samples import SeenInjection
from observer_rt.desk.live_page.watching import FULL, Watching
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import REASONS, STATES, is_good
from observer_rt.foundation.files import templates_of

_LATELY = 100  # injections of which the share of valid ones is shown
OLD = 2.0  # s after which numbers are not those of now
MINUTE = 60.0  # s
_BUSY = 0.8  # share of the time from which a bus is hardly able to carry more


def top_html(watching: Watching) -> str:
    """The clock and the buses."""
    return _TEMPLATES.get_template("top.html").render(watching=watching)


def banner_html(seen: Seen, is_over: bool = False) -> str:
    """State and faults of one injector now; is_over: nothing comes any more, all is of before."""
    kind, state, words = _state(seen)
    return _TEMPLATES.get_template("banner.html").render(
        seen=seen, kind="bad" if seen.faults else "over" if is_over else kind, state=state, words=words
    )


def numbers_html(seen: Seen, now: int) -> str:
    """The last injection of one injector at a time [ns since 1970], pale once it is old."""
    shown = last_of(seen)
    lately = seen.injections[-_LATELY:]
    valid = sum(each.summary.valid == 1.0 for each in lately) / max(1, len(lately))
    age = 0.0 if shown is None else max(0.0, (now - shown.moment) / SECOND)
    return _TEMPLATES.get_template("numbers.html").render(
        seen=seen,
        shown=shown,
        number=number_of(seen),
        validity="" if shown is None else _validity(shown),
        lately=len(lately),
        valid_share=valid,
        # as often as it changes it is drawn
        age=f"{age:.0f} s ago" if age < MINUTE else f"{age / MINUTE:.0f} min ago",
        is_old=age > OLD or seen.silent_since is not None,
    )


def last_of(seen: Seen) -> SeenInjection | None:
    """The injection shown."""
    return seen.injections[-1] if seen.injections else None


def number_of(seen: Seen) -> str:
    """Number of the injection shown, as the observer counts; empty: there is none, or its number is not known."""
    shown = last_of(seen)
    number = math.nan if shown is None else shown.summary.injection_number
    return "" if math.isnan(number) else f"{number:.0f}"


def _state(seen: Seen) -> tuple[str, str, str]:
    """State of an injector: its colour, a class of page.css, its name, and words."""
    status = seen.status
    if seen.silent_since is not None:
        return "bad", "OBSERVER SILENT", f"since {_clock(seen.silent_since)}: all below is old"
    if status is None or math.isnan(status.state):
        return "waiting", "no status yet", "nothing was heard of the observer"
    state, reason = State(int(status.state)), Reason(int(status.reason))
    words = STATES[state].what if reason is Reason.NONE else f"{reason.name}: {REASONS[reason].what}"
    if is_good(state):
        return ("good" if reason in (Reason.NONE, Reason.JUMPED) else "waiting"), state.name, words
    if state in (State.STARTING, State.WAITING_FOR_DATA):  # a fault once it lasts
        return "waiting", state.name, words
    return "bad", state.name, words


def _validity(shown: SeenInjection) -> str:
    if shown.summary.valid == 1.0:
        return "valid"
    reason = Reason(int(shown.summary.reason))
    return f"not valid: {reason.name}, {REASONS[reason].what}"


def _clock(moment: int) -> str:
    """A moment [ns since 1970] as local time."""
    return datetime.fromtimestamp(moment / SECOND).strftime("%H:%M:%S")


_TEMPLATES = templates_of(__package__)
_TEMPLATES.filters["clock"] = _clock
_TEMPLATES.tests["known"] = math.isfinite
_TEMPLATES.globals |= {"nan": math.nan, "SURE": SURE, "BUSY": _BUSY, "FULL": FULL}
