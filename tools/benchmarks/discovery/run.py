"""`tools/bench discovery`: hide, ask, and, when all answers are in, open what was hidden and score."""

import shutil
from collections.abc import Iterator

from tools.benchmarks.command_line import messages
from tools.benchmarks.discovery.answers import Answer, ask
from tools.benchmarks.discovery.asking import (
    WARM_UP_RECORDINGS,
    Asking,
    Found,
    Question,
    ask_and_score,
    seal,
)
from tools.benchmarks.discovery.cases import HIDING, HidingPlan, make_case, write_recordings
from tools.benchmarks.discovery.hidden import HEALTHY
from tools.benchmarks.discovery.result import CaseResult, violations
from tools.benchmarks.discovery.scoring import score_answered
from tools.benchmarks.discovery.tables import confusion_table, effect_table, misses, reliability_table
from tools.benchmarks.report import Shown
from tools.benchmarks.runs import BENCHMARKS, PACKAGE

HIDING_SOURCES = tuple(
    BENCHMARKS / name
    for name in (
        "plant.py",
        "plant_equations.py",
        "plant_laws.py",
        "plant_parameters.py",
        "discovery/hidden.py",
        "discovery/cases.py",
        "discovery/hiding.py",
        "discovery/answers.py",
    )
)
"""What, with the package, an answer depends on."""


def run_discovery(asking: Asking[HidingPlan]) -> Found[CaseResult]:
    """Ask about the cases not yet asked about with this state of the code, then score."""
    hidden, campaign = asking.hidden, asking.campaign
    seal(asking.plan, hidden)
    labels = HIDING.labels_in(hidden)
    answers = campaign.store("answers", Answer, PACKAGE, *HIDING_SOURCES)
    results = campaign.store("results", CaseResult, PACKAGE, BENCHMARKS)
    if {answer.label for answer in answers.load()}.isdisjoint(labels):
        messages.print("first call of discover, which compiles")
        _warm_up(asking)
    questions = [Question(label, asking) for label in labels]
    return ask_and_score(campaign, questions, answers, lambda: HIDING.opened(hidden), score_answered, results)


def shown(found: Found[CaseResult]) -> Iterator[Shown]:
    """The tables, then a line for every miss, every bar that is missed and every crash."""
    for table in (effect_table, confusion_table, reliability_table):
        yield table(found.results)
    yield from (f"missed: {line}" for line in misses(found.results))
    yield from (f"bar missed: {line}" for line in violations(found.results))
    yield from (f"crash: {line}" for line in found.crashes)


def _warm_up(asking: Asking[HidingPlan]) -> None:
    """Compile, or load from the cache, so that no case's seconds hold it."""
    folder = asking.out / "warm-up"
    for with_rate in (False, True):
        files = write_recordings(make_case(HEALTHY, with_rate, 0, 0), folder / "recordings")
        ask(asking.program, "warm-up", files[:WARM_UP_RECORDINGS], folder / "answer")
        shutil.rmtree(folder)
