"""`tools/bench discovery --tier B`: hide, fit, ask, and, when all answers are in, open what was hidden and score."""

import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.foundation.errors import RunError
from tools.benchmarks.discovery.answers import OUR_PROGRAM, Answer, ask
from tools.benchmarks.discovery.asking import ask_and_keep, worked_through
from tools.benchmarks.discovery.real_line.cases import RealCase, Rig
from tools.benchmarks.discovery.real_line.fitting import (
    HEALTHY,
    fitted_model,
    generate,
    seal_cases,
    state_of_the_code,
)
from tools.benchmarks.discovery.real_line.generator import RealPlan, labels_of, opened
from tools.benchmarks.discovery.real_line.result import RealResult
from tools.benchmarks.discovery.real_line.scoring import score_case
from tools.benchmarks.discovery.real_line.summary import violations
from tools.benchmarks.discovery.real_line.tables import (
    discrepancy_table,
    effect_table,
    kind_lines,
    misses,
)
from tools.benchmarks.discovery.run import BENCHMARKS, PACKAGE
from tools.benchmarks.store import Store, digest_of

WARM_UP_RECORDINGS = 2


@dataclass(frozen=True)
class Asking:
    """A plan, whom to ask (a program with the verbs `fit` and `discover`), on how many processes, where all goes."""

    plan: RealPlan
    workers: int
    out: Path
    program: tuple[str, ...] = OUR_PROGRAM

    @property
    def sealed(self) -> Path:
        """Folder of what is sealed, and of recordings while they are asked about."""
        return self.out / "hidden"


@dataclass(frozen=True)
class RealResults:
    """What came out; adequate: what `fit` says of its model, by rig; a line for every case or fit that failed."""

    results: tuple[RealResult, ...]
    adequate: dict[str, bool]
    crashes: tuple[str, ...]


@dataclass(frozen=True)
class Question:
    """A case to ask about: its label and the fitted model are all that is known of it."""

    label: str
    model: Path
    asking: Asking


@dataclass(frozen=True)
class Answered:
    """A case, opened, its answer and the model that was given."""

    label: str
    case: RealCase
    answer: Answer
    model: Path


def run_real_lines(asking: Asking, console: Console) -> RealResults:
    """Fit, and ask about the cases not yet asked about with this state of the code; progress goes to `console`."""
    seal_cases(asking.plan, asking.sealed)
    labels = labels_of(asking.sealed)
    crashes: list[str] = []
    answers = Store(asking.out / "answers.jsonl", Answer, state_of_the_code())
    missing = {label.label for label in labels} - {answer.label for answer in answers.load()}
    wanted = {label.rig for label in labels if label.label in missing}
    models = _models({label.rig for label in labels}, wanted, asking, console, crashes)
    questions = [Question(one.label, models[one.rig], asking) for one in labels if one.rig in models]
    given = worked_through("answers", answers, ask_question, questions, asking.workers, console, crashes)

    results = Store(asking.out / "results.jsonl", RealResult, digest_of((PACKAGE, BENCHMARKS)))
    answered = [
        Answered(case.label, case, given[case.label], models[case.rig])
        for case in opened(asking.sealed)
        if case.label in given
    ]
    scored = worked_through("scores", results, score_answered, answered, asking.workers, console, crashes)
    found = tuple(scored[one.label] for one in labels if one.label in scored)
    adequate = {rig.open_name: _adequate(model) for rig, model in models.items()}
    return RealResults(found, adequate, tuple(crashes))


def print_results(found: RealResults, console: Console) -> None:
    """The tables, then a line for every miss, every bar that is missed and every crash."""
    console.print(discrepancy_table(found.results, found.adequate))
    console.print(effect_table(found.results))
    for line in kind_lines(found.results):
        console.print(line, highlight=False)
    for title, lines in (
        ("missed", misses(found.results)),
        ("bar missed", violations(found.results, len(found.crashes))),
        ("crash", found.crashes),
    ):
        for line in lines:
            console.print(f"{title}: {line}", highlight=False, markup=False)


def ask_question(question: Question) -> Answer:
    """Work of one process: have a case recorded, and ask. Its findings stay in `out`, nothing else."""
    label, asking = question.label, question.asking
    files = generate("record", asking.sealed, label, str(asking.sealed / label))
    return ask_and_keep(asking.program, label, files, asking.out, question.model, choose=False)


def score_answered(answered: Answered) -> RealResult:
    """Work of one process: score an opened case."""
    return score_case(answered.case, answered.answer, answered.model)


def _models(
    rigs: set[Rig], wanted: set[Rig], asking: Asking, console: Console, crashes: list[str]
) -> dict[Rig, Path]:
    """The fitted model of every rig; those wanted are asked with once, which compiles."""
    models: dict[Rig, Path] = {}
    for number, rig in enumerate(sorted(rigs, key=lambda rig: rig.name), start=1):
        folder = asking.out / "rigs" / rig.name
        try:
            models[rig] = fitted_model(rig, asking.sealed, folder, asking.program)
        except RunError as error:
            crashes.append(f"fit: rig {rig.name}: {error}")
            continue
        if rig in wanted:
            console.print(f"rig {number} of {len(rigs)}: fitted; first call of discover, which may compile")
            _warm_up(models[rig], folder, asking.program)
    return models


def _warm_up(model: Path, folder: Path, program: Sequence[str]) -> None:
    """Compile, or load from the cache, so that no case's seconds hold it: every line is compiled for itself."""
    recordings, answer = sorted((folder / HEALTHY).glob("*.csv"))[:WARM_UP_RECORDINGS], folder / "warm-up"
    try:
        ask(program, "warm-up", recordings, answer, model, choose=False)
    except RuntimeError:  # a case will fail as well, and is told of
        return
    finally:
        shutil.rmtree(answer, ignore_errors=True)


def _adequate(model: Path) -> bool:
    """Whether `fit` says its model explains the healthy recordings."""
    return bool(tomllib.loads(model.read_text()).get("baseline", {}).get("adequate", False))
