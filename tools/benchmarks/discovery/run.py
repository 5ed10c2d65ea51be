"""`tools/bench discovery`: hide, fit in tier B, ask, and, when all answers are in, open what was hidden and score."""

import shutil
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from tools.benchmarks.campaign import MEASURING, PACKAGE, Found
from tools.benchmarks.command_line import messages
from tools.benchmarks.discovery import cases, result, tables
from tools.benchmarks.discovery.answers import Answer, ask
from tools.benchmarks.discovery.asking import Asking, Question, ask_and_score, seal
from tools.benchmarks.discovery.hidden import HEALTHY
from tools.benchmarks.discovery.real_line import cases as real_cases
from tools.benchmarks.discovery.real_line import fitting
from tools.benchmarks.discovery.real_line import result as real_result
from tools.benchmarks.discovery.real_line import tables as real_tables
from tools.benchmarks.discovery.scoring import score_answered, score_real
from tools.benchmarks.report import Shown, crash_lines

WARM_UP_RECORDINGS = 2


def run_discovery(asking: Asking[cases.HidingPlan]) -> Found[result.CaseResult]:
    """Ask about the cases not yet asked about with this state of the code, then score."""
    hidden, campaign, hiding = asking.hidden, asking.campaign, cases.HIDING
    seal(asking.plan, hidden)
    labels = hiding.labels_in(hidden)
    answers = campaign.store("answers", Answer, PACKAGE, *fitting.NOMINAL_SOURCES)
    results = campaign.store("results", result.CaseResult, PACKAGE, *MEASURING)
    if {answer.label for answer in answers.load()}.isdisjoint(labels):
        messages.print("first call of discover, which compiles")
        folder = asking.out / "warm-up"
        for with_rate in (False, True):
            files = cases.write_recordings(cases.make_case(HEALTHY, with_rate, 0, 0), folder / "recordings")
            ask(asking.program, "warm-up", files[:WARM_UP_RECORDINGS], folder / "answer")
            shutil.rmtree(folder)
    questions = [Question(label, asking) for label in labels]
    return ask_and_score(campaign, questions, answers, lambda: hiding.opened(hidden), score_answered, results)


def shown(found: Found[result.CaseResult]) -> Iterator[Shown]:
    """The tables, then a line for every miss, every bar that is missed and every crash."""
    for table in (tables.effect_table, tables.confusion_table, tables.reliability_table):
        yield table(found.results)
    hidden = result.counted_grades(r.grade for r in result.faulty(found.results))
    yield result.grades_line("hidden effects", hidden)
    yield from (f"missed: {line}" for line in tables.misses(found.results))
    yield from (f"bar missed: {line}" for line in result.violations(found.results))
    yield from crash_lines(found.crashes)


@dataclass(frozen=True)
class RealResults(Found[real_result.RealResult]):
    """adequate: what `fit` says of its model, by rig; a line for every fit that failed, too."""

    adequate: dict[str, bool]


def run_real_lines(asking: Asking[real_cases.RealPlan]) -> RealResults:
    """Fit, and ask about the cases not yet asked about with this state of the code."""
    hidden, campaign, failed, hiding = asking.hidden, asking.campaign, list[str](), real_cases.HIDING
    seal(asking.plan, hidden)
    labels = hiding.labels_in(hidden)
    answers = campaign.store("answers", Answer, PACKAGE, *fitting.HIDING_SOURCES)
    results = campaign.store("results", real_result.RealResult, PACKAGE, *MEASURING)
    missing = {label.label for label in labels} - {answer.label for answer in answers.load()}
    models = fitting.fitted_models({label.rig for label in labels}, asking, failed)
    for rig in {label.rig for label in labels if label.label in missing} & models.keys():
        folder = models[rig].parent  # every line is compiled for itself
        with suppress(RuntimeError):  # a case will fail as well, and is told of
            files = sorted((folder / fitting.HEALTHY).glob("*.csv"))[:WARM_UP_RECORDINGS]
            ask(asking.program, "warm-up", files, folder / "warm-up", models[rig], choose=False)
        shutil.rmtree(folder / "warm-up", ignore_errors=True)
    asked = [label for label in labels if label.rig in models]
    questions = [Question(one.label, asking, models[one.rig], choose=False) for one in asked]
    found = ask_and_score(campaign, questions, answers, lambda: hiding.opened(hidden), score_real, results)
    fitted = {rig: tomllib.loads(model.read_text()) for rig, model in models.items() if rig is not None}
    adequate = {
        rig.open_name: bool(told.get("baseline", {}).get("adequate", False)) for rig, told in fitted.items()
    }
    return RealResults(found.results, (*failed, *found.crashes), adequate)


def real_shown(found: RealResults) -> Iterator[Shown]:
    """As `shown`."""
    yield real_tables.discrepancy_table(found.results, found.adequate)
    yield real_tables.effect_table(found.results)
    yield from real_tables.kind_lines(found.results)
    yield from (f"missed: {line}" for line in real_tables.misses(found.results))
    missed = real_result.violations(found.results, len(found.crashes))
    yield from (f"bar missed: {line}" for line in missed)
    yield from crash_lines(found.crashes)
