"""One table of words: docs/operating.md, the databases' value tables and the log say the same."""

import io
import json
import re
from dataclasses import replace

import pytest
from rich.console import Console

from observer_rt.bus.mapping.output_signals import StatusValues
from observer_rt.config.bench import load_injector
from observer_rt.daemon.log import EventLogger, ServiceLog
from observer_rt.daemon.notifier import Notifier
from observer_rt.engine.estimation.parameters import OFFSET
from observer_rt.engine.reports.indicators import Estimate
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import COUNTERS, REASONS, STATES, TOPICS, Topic
from observer_rt.model.effects import effective_model
from tests.daemon.samples import some_report
from tests.pages import Page
from tools.lib.word_tables import DATABASES, database_with_words, page_with_words

PAGE = Page("docs/operating.md")
NO_COUNTERS = {  # of the status; the rest counts something
    *("sample_index", "valid", "learning", "state", "reason", "injector_id", "model_hash", "database_hash"),
    *("version_major", "version_minor", "version_patch", "troubled_bus"),
    *("rail_pressure_age", "needle_lift_age", "line_pressure_age", "latency_p999", "largest_latency"),
}


def test_every_state_and_reason_has_words() -> None:
    assert (set(STATES), set(REASONS), set(TOPICS)) == (set(State), set(Reason), set(Topic))
    assert set(COUNTERS) == set(StatusValues._fields) - NO_COUNTERS


def test_page_and_databases_are_up_to_date() -> None:
    """Else: tools/words."""
    assert page_with_words(PAGE.text) == PAGE.text
    for path in DATABASES:
        text = path.read_text("utf-8")
        assert database_with_words(text) == text


def test_a_table_of_the_page_is_written_anew() -> None:
    spoilt = PAGE.text.replace("| `JUMPED` | the source", "| `JUMPT` | a source")
    assert spoilt != PAGE.text
    assert page_with_words(spoilt) == PAGE.text


def test_the_page_names_every_key_of_the_records() -> None:
    stream = io.StringIO()
    with ServiceLog(Console(file=io.StringIO()), stream=stream) as log:
        EventLogger(log, Notifier({}), effective_model(load_injector()).coefficients, "").hear(some_report())
    section = PAGE.text.split("\n## Injections as JSON\n")[1].split("\n    ")[0]
    assert set(re.findall(r"`(\w+)`", section)) - {"null"} == set(json.loads(stream.getvalue()))


def test_an_offset_is_told_with_its_size() -> None:
    stream = io.StringIO()
    report = some_report(valid=False, reason=Reason.PRESSURE_OFFSET)
    report = replace(report, indicators={**report.indicators, OFFSET: Estimate(0.03)})
    with ServiceLog(Console(file=stream)) as log:
        teller = EventLogger(log, Notifier({}), effective_model(load_injector()).coefficients, "")
        for item in (report, replace(report, reason=Reason.SENSOR_LAG)):
            teller.hear(item)
    offset, lag = stream.getvalue().splitlines()
    assert offset.endswith(", line pressure reads +3.00 MPa off")
    assert "MPa off" not in lag


@pytest.mark.parametrize("words", [*STATES.values(), *REASONS.values(), *COUNTERS.values(), *TOPICS.values()])
def test_words_fit_tables_and_databases(words) -> None:  # type: ignore[no-untyped-def]
    """Plain characters, no bar that would end a cell, no quote that would end a DBC text, short."""
    assert re.fullmatch(r"[ -!#-{}~]{3,70}", words.what)
    assert re.fullmatch(r"[ -!#-{}~]{3,160}", words.remedy)
