"""One table of words: docs/operating.md, the databases' value tables and the log say the same."""

import io
import json
import logging
import re

import cantools.database
import pytest
from rich.console import Console

from observer_rt.bus.mapping.output_messages import StatusValues, signals_of
from observer_rt.config.bench import PACKAGE_DATA, load_injector
from observer_rt.model.effects import effective_model
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.log import ServiceLog, Voice
from observer_rt.service.notify import Notifier
from observer_rt.service.reports.once import Once
from observer_rt.service.reports.telling import Teller
from observer_rt.service.words import COUNTERS, REASONS, STATES, TOPICS, Topic, named
from tests.pages import Page
from tests.service.keeping.report_samples import some_report

PAGE = Page("docs/operating.md")
NO_COUNTERS = {  # of the status; the rest counts something
    *("sample_index", "valid", "learning", "state", "reason", "injector_id", "model_hash", "database_hash"),
    *("version_major", "version_minor", "version_patch", "troubled_bus"),
    *("rail_pressure_age", "needle_lift_age", "line_pressure_age"),
}


def table(heading: str) -> list[tuple[str, ...]]:
    """Cells of the rows of the page's table below a heading."""
    section = PAGE.text.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `(.*?)` \| (.*) \|$", section, re.MULTILINE)
    return [(name, *rest.split(" | ")) for name, rest in rows]


def test_every_state_and_reason_has_words() -> None:
    assert set(STATES) == set(State)
    assert set(REASONS) == set(Reason)
    assert set(TOPICS) == set(Topic)
    assert set(COUNTERS) == set(StatusValues._fields) - NO_COUNTERS


def test_the_page_says_the_same_of_states() -> None:
    assert table("States") == [(s.name, w.what, w.remedy) for s, w in STATES.items()]


def test_the_page_says_the_same_of_reasons() -> None:
    assert table("Reasons") == [(r.name, str(int(r)), w.what, w.remedy) for r, w in REASONS.items()]


def test_the_page_says_the_same_of_counters() -> None:
    signals = dict(zip(StatusValues._fields, signals_of(StatusValues), strict=True))
    assert table("Counters") == [(signals[name], w.what, w.remedy) for name, w in COUNTERS.items()]


def test_the_page_says_the_same_of_log_lines() -> None:
    expected = [(str(t), logging.getLevelName(w.level), w.what, w.remedy) for t, w in TOPICS.items()]
    assert table("The log") == expected


def test_the_page_names_every_key_of_the_records() -> None:
    stream = io.StringIO()
    with ServiceLog(Console(file=io.StringIO()), stream=stream) as log:
        teller = Teller(Voice(log, ""), Notifier({}), effective_model(load_injector()).coefficients, Once())
        teller.hear(some_report())
    section = PAGE.text.split("\n## Injections as JSON\n")[1].split("\n    ")[0]
    assert set(re.findall(r"`(\w+)`", section)) - {"null"} == set(json.loads(stream.getvalue()))


@pytest.mark.parametrize("database", ["observer_fd.dbc", "observer_classic.dbc"])
def test_the_databases_say_the_same(database: str) -> None:
    for message in cantools.database.load_file(PACKAGE_DATA / database).messages:
        for name, members in (("State", State), ("Reason", Reason)):
            for signal in (signal for signal in message.signals if signal.name == name):
                choices = signal.choices or {}
                assert {int(code): str(text) for code, text in choices.items()} == {
                    int(member): named(member) for member in members
                }


@pytest.mark.parametrize("words", [*STATES.values(), *REASONS.values(), *COUNTERS.values(), *TOPICS.values()])
def test_words_fit_tables_and_databases(words) -> None:  # type: ignore[no-untyped-def]
    """Plain characters, no bar that would end a cell, no quote that would end a DBC text, short."""
    assert re.fullmatch(r"[ -!#-{}~]{3,70}", words.what)
    assert re.fullmatch(r"[ -!#-{}~]{3,160}", words.remedy)
