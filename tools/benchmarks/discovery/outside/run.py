"""`tools/bench discovery --outside`: hide, fit in tier B, ask, and open what was hidden when all answers are in."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools.benchmarks.campaign import PACKAGE, Found
from tools.benchmarks.discovery.asking import Asking, Question, recorded, seal
from tools.benchmarks.discovery.outside.answers import OutsideAnswer, ask_outside
from tools.benchmarks.discovery.outside.cases import HIDING, Asked, OutsidePlan
from tools.benchmarks.discovery.outside.result import OutsideResult, asked_for, figures
from tools.benchmarks.discovery.outside.tables import answer_table, case_lines, kind_table
from tools.benchmarks.discovery.real_line.fitting import HIDING_SOURCES, fitted_models
from tools.benchmarks.report import Shown, crash_lines, figures_table

HERE = Path(__file__).parent
SOURCES = (
    *HIDING_SOURCES,
    *(HERE / f"{name}.py" for name in ("kinds", "cases", "answers")),
)
"""What, with the package, an answer depends on."""


@dataclass(frozen=True)
class OutsideQuestion(Question):
    """A case to ask about, and the names the vocabulary has not."""

    without: tuple[str, ...] = ()


def run_outside(asking: Asking[OutsidePlan]) -> Found[OutsideResult]:
    """Ask about the cases not yet asked about with this state of the code."""
    hidden, campaign, failed = asking.hidden, asking.campaign, list[str]()
    seal(asking.plan, hidden)
    labels = HIDING.labels_in(hidden)
    models = fitted_models({label.rig for label in labels}, asking, failed)
    questions = [
        OutsideQuestion(one.label, asking, models[one.rig], without=one.without)
        for one in labels
        if one.rig in models
    ]
    store = campaign.store("answers", OutsideAnswer, PACKAGE, *SOURCES)
    given = campaign.results("answers", store, ask_outside_question, questions)
    found = [OutsideResult(case, given[case.label]) for case in HIDING.opened(hidden) if case.label in given]
    return Found(tuple(found), (*failed, *campaign.crashes))


def shown(found: Found[OutsideResult], tier: str) -> Iterator[Shown]:
    """The tables, then a line for every case with something wrong and every crash."""
    for asked in Asked:
        if asked_for(found.results, asked):
            yield kind_table(found.results, asked)
    yield answer_table(found.results)
    yield figures_table(figures(found.results, tier), f"outside the vocabulary, tier {tier}")
    yield from case_lines(found.results)
    yield from crash_lines(found.crashes)


def ask_outside_question(question: OutsideQuestion) -> OutsideAnswer:
    """Work of one process: have a case recorded, and ask."""
    folder = question.asking.hidden / question.label
    try:
        recorded(question)
        return ask_outside(question.label, folder, question.model, question.without)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
