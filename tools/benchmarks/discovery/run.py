"""`tools/bench discovery`: hide, ask, and, when all answers are in, open what was hidden and score."""

import json
import shutil
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console

import observer_rt
from tools.benchmarks.discovery.answers import OUR_PROGRAM, Answer, ask
from tools.benchmarks.discovery.asking import ask_and_keep, worked_through
from tools.benchmarks.discovery.cases import HiddenCase, make_case
from tools.benchmarks.discovery.generator import LABELS, HidingPlan, opened, write_recordings
from tools.benchmarks.discovery.hidden import HEALTHY
from tools.benchmarks.discovery.result import CaseResult
from tools.benchmarks.discovery.scoring import score_case
from tools.benchmarks.discovery.summary import violations
from tools.benchmarks.discovery.tables import confusion_table, effect_table, misses, reliability_table
from tools.benchmarks.store import Store, digest_of

BENCHMARKS = Path(__file__).parents[1]
PACKAGE = Path(observer_rt.__file__).parent
GENERATOR = "tools.benchmarks.discovery.generator"
HIDING_SOURCES = tuple(
    BENCHMARKS / name
    for name in (
        "plant.py",
        "plant_equations.py",
        "plant_parameters.py",
        "plant_phases.py",
        "discovery/hidden.py",
        "discovery/cases.py",
        "discovery/generator.py",
        "discovery/answers.py",
    )
)
"""What, with the package, an answer depends on."""
WARM_UP_RECORDINGS = 2


@dataclass(frozen=True)
class Plan:
    """What to hide, whom to ask (a program with a verb `discover`), on how many processes, where everything goes."""

    hiding: HidingPlan
    workers: int
    out: Path
    program: tuple[str, ...] = OUR_PROGRAM

    @property
    def hidden(self) -> Path:
        """Folder of what is sealed."""
        return self.out / "hidden"


@dataclass(frozen=True)
class Results:
    """What came out, and a line for every case that failed."""

    results: tuple[CaseResult, ...]
    crashes: tuple[str, ...]


def run_discovery(plan: Plan, console: Console) -> Results:
    """Ask about the cases not yet asked about with this state of the code, then score; progress goes to `console`."""
    hidden = plan.hidden
    _generate("seal", hidden, given=json.dumps(asdict(plan.hiding)))
    labels = json.loads((hidden / LABELS).read_text())
    crashes: list[str] = []

    answers = Store(plan.out / "answers.jsonl", Answer, digest_of((PACKAGE, *HIDING_SOURCES)))
    questions = [Question(label, plan) for label in labels]
    if {answer.label for answer in answers.load()}.isdisjoint(labels):
        console.print("first call of discover, which compiles")
        _warm_up(plan)
    given = worked_through("answers", answers, ask_question, questions, plan.workers, console, crashes)

    results = Store(plan.out / "results.jsonl", CaseResult, digest_of((PACKAGE, BENCHMARKS)))
    answered = [
        Answered(case.label, case, given[case.label]) for case in opened(hidden) if case.label in given
    ]
    scored = worked_through("scores", results, score_answered, answered, plan.workers, console, crashes)
    return Results(tuple(scored[label] for label in labels if label in scored), tuple(crashes))


def print_results(found: Results, console: Console) -> None:
    """The tables, then a line for every miss, every bar that is missed and every crash."""
    for table in (effect_table, confusion_table, reliability_table):
        console.print(table(found.results))
    for title, lines in (
        ("missed", misses(found.results)),
        ("bar missed", violations(found.results)),
        ("crash", found.crashes),
    ):
        for line in lines:
            console.print(f"{title}: {line}", highlight=False, markup=False)


@dataclass(frozen=True)
class Question:
    """A case to ask about: its label is all that is known of it."""

    label: str
    plan: Plan


def ask_question(question: Question) -> Answer:
    """Work of one process: have a case recorded, and ask. Its findings stay in `out`, nothing else."""
    label, plan = question.label, question.plan
    files = _generate("record", plan.hidden, label).splitlines()
    return ask_and_keep(plan.program, label, [Path(file) for file in files], plan.out)


@dataclass(frozen=True)
class Answered:
    """A case, opened, and its answer."""

    label: str
    case: HiddenCase
    answer: Answer


def score_answered(answered: Answered) -> CaseResult:
    """Work of one process: score an opened case."""
    return score_case(answered.case, answered.answer)


def _generate(verb: str, folder: Path, *arguments: str, given: str = "") -> str:
    """Run the generator, the only process that knows what is hidden before the answers are in; its output."""
    command = [sys.executable, "-m", GENERATOR, verb, str(folder), *arguments]
    return subprocess.run(command, input=given, stdout=subprocess.PIPE, text=True, check=True).stdout


def _warm_up(plan: Plan) -> None:
    """Compile, or load from the cache, so that no case's seconds hold it."""
    folder = plan.out / "warm-up"
    for with_rate in (False, True):
        files = write_recordings(make_case(HEALTHY, with_rate, 0, 0), folder / "recordings")
        ask(plan.program, "warm-up", files[:WARM_UP_RECORDINGS], folder / "answer")
        shutil.rmtree(folder)
