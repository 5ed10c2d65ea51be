"""`tools/bench discovery --outside`: hide, fit in tier B, ask, and open what was hidden when all answers are in."""

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.foundation.errors import RunError
from tools.benchmarks.command_line import print_lines
from tools.benchmarks.discovery.asking import Asking, Question, generate
from tools.benchmarks.discovery.outside.answers import OutsideAnswer, ask_outside
from tools.benchmarks.discovery.outside.cases import Asked, OutsidePlan
from tools.benchmarks.discovery.outside.generator import labels_of, opened
from tools.benchmarks.discovery.outside.result import OutsideResult, asked_for
from tools.benchmarks.discovery.outside.tables import answer_table, bar_table, case_lines, kind_table
from tools.benchmarks.discovery.real_line.cases import Rig
from tools.benchmarks.discovery.real_line.fitting import HIDING_SOURCES, fitted_model
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Crash, Store, digest_of, resumed

GENERATOR = "tools.benchmarks.discovery.outside.generator"
HERE = Path(__file__).parent
SOURCES = (
    *HIDING_SOURCES,
    BENCHMARKS / "plant_laws.py",
    *(HERE / f"{name}.py" for name in ("kinds", "cases", "generator", "answers")),
)
"""What, with the package, an answer depends on."""


@dataclass(frozen=True)
class OutsideQuestion(Question):
    """A case to ask about, and the names the vocabulary has not."""

    without: tuple[str, ...] = ()


@dataclass(frozen=True)
class OutsideResults:
    """What came out, and a line for every fit or case that failed."""

    results: tuple[OutsideResult, ...]
    crashes: tuple[str, ...]


def run_outside(asking: Asking[OutsidePlan], console: Console) -> OutsideResults:
    """Ask about the cases not yet asked about with this state of the code; progress goes to `console`."""
    hidden, crashes = asking.hidden, list[str]()
    generate(GENERATOR, "seal", hidden, given=json.dumps(asdict(asking.plan)))
    labels = labels_of(hidden)
    models = _models({label.rig for label in labels}, asking, console, crashes)
    questions = [
        OutsideQuestion(one.label, asking, models[one.rig], one.without)
        for one in labels
        if one.rig in models
    ]

    def failed(crash: Crash[OutsideQuestion]) -> None:
        crashes.append(f"{crash.task.label}: {crash.message}")

    store = Store(asking.out / "answers.jsonl", OutsideAnswer, digest_of((PACKAGE, *SOURCES)))
    given = resumed("answers", store, ask_question, questions, asking.workers, console, failed)
    found = [OutsideResult(case, given[case.label]) for case in opened(hidden) if case.label in given]
    return OutsideResults(tuple(found), tuple(crashes))


def print_results(found: OutsideResults, tier: str, console: Console) -> None:
    """The tables, then a line for every case with something wrong and every crash."""
    for asked in Asked:
        if asked_for(found.results, asked):
            console.print(kind_table(found.results, asked))
    console.print(answer_table(found.results))
    console.print(bar_table(found.results, tier))
    print_lines(console, case_lines(found.results))
    print_lines(console, found.crashes, "crash: ")


def ask_question(question: OutsideQuestion) -> OutsideAnswer:
    """Work of one process: have a case recorded, and ask."""
    folder = question.asking.hidden / question.label
    try:
        generate(GENERATOR, "record", question.asking.hidden, question.label)
        return ask_outside(question.label, folder, question.model, question.without)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _models(
    rigs: set[Rig | None], asking: Asking[OutsidePlan], console: Console, crashes: list[str]
) -> dict[Rig | None, Path]:
    """The fitted model of every rig; of a plant that is the nominal injector's, its own."""
    models: dict[Rig | None, Path] = {None: NOMINAL_INJECTOR}
    for number, rig in enumerate(sorted(filter(None, rigs), key=lambda rig: rig.name), start=1):
        try:
            models[rig] = fitted_model(rig, asking.hidden, asking.out / "rigs" / rig.name, asking.program)
            console.print(f"rig {number} of {len(rigs)}: fitted")
        except RunError as error:
            crashes.append(f"fit: rig {rig.name}: {error}")
    return models
