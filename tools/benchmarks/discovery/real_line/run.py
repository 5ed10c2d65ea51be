"""`tools/bench discovery --tier B`: hide, fit, ask, and, when all answers are in, open what was hidden and score."""

import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.foundation.errors import RunError
from tools.benchmarks.command_line import print_lines
from tools.benchmarks.discovery.answers import Answer, ask
from tools.benchmarks.discovery.asking import (
    WARM_UP_RECORDINGS,
    Answered,
    Asking,
    Question,
    ask_and_keep,
    ask_and_score,
)
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
from tools.benchmarks.discovery.real_line.tables import discrepancy_table, effect_table, kind_lines, misses
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Store, digest_of


@dataclass(frozen=True)
class RealResults:
    """What came out; adequate: what `fit` says of its model, by rig; a line for every case or fit that failed."""

    results: tuple[RealResult, ...]
    adequate: dict[str, bool]
    crashes: tuple[str, ...]


def run_real_lines(asking: Asking[RealPlan], console: Console) -> RealResults:
    """Fit, and ask about the cases not yet asked about with this state of the code; progress goes to `console`."""
    hidden, crashes = asking.hidden, list[str]()
    seal_cases(asking.plan, hidden)
    labels = labels_of(hidden)
    answers = Store(asking.out / "answers.jsonl", Answer, state_of_the_code())
    results = Store(asking.out / "results.jsonl", RealResult, digest_of((PACKAGE, BENCHMARKS)))
    missing = {label.label for label in labels} - {answer.label for answer in answers.load()}
    wanted = {label.rig for label in labels if label.label in missing}
    models = _models({label.rig for label in labels}, wanted, asking, console, crashes)
    questions = [Question(one.label, asking, models[one.rig]) for one in labels if one.rig in models]
    scored = ask_and_score(
        questions, ask_question, answers, lambda: opened(hidden),
        score_answered, results, asking.workers, console, crashes,
    )  # fmt: skip
    found = tuple(scored[one.label] for one in labels if one.label in scored)
    adequate = {rig.open_name: _adequate(model) for rig, model in models.items()}
    return RealResults(found, adequate, tuple(crashes))


def print_results(found: RealResults, console: Console) -> None:
    """The tables, then a line for every miss, every bar that is missed and every crash."""
    console.print(discrepancy_table(found.results, found.adequate))
    console.print(effect_table(found.results))
    for line in kind_lines(found.results):
        console.print(line, highlight=False)
    print_lines(console, misses(found.results), "missed: ")
    print_lines(console, violations(found.results, len(found.crashes)), "bar missed: ")
    print_lines(console, found.crashes, "crash: ")


def ask_question(question: Question) -> Answer:
    """Work of one process: have a case recorded, and ask. Its findings stay in `out`, nothing else."""
    label, hidden = question.label, question.asking.hidden
    files = generate("record", hidden, label, str(hidden / label))
    return ask_and_keep(question, files, choose=False)


def score_answered(answered: Answered[RealCase]) -> RealResult:
    """Work of one process: score an opened case."""
    return score_case(answered.case, answered.answer, answered.model)


def _models(
    rigs: set[Rig], wanted: set[Rig], asking: Asking[RealPlan], console: Console, crashes: list[str]
) -> dict[Rig, Path]:
    """The fitted model of every rig; those wanted are asked with once, which compiles."""
    models: dict[Rig, Path] = {}
    for number, rig in enumerate(sorted(rigs, key=lambda rig: rig.name), start=1):
        folder = asking.out / "rigs" / rig.name
        try:
            models[rig] = fitted_model(rig, asking.hidden, folder, asking.program)
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
