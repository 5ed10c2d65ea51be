"""Asking about many cases: what is hidden is known to a process of its own until all answers are in."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from observer_rt.config.bench import NOMINAL_INJECTOR
from tools.benchmarks.campaign import Campaign, Found, Labelled, Store
from tools.benchmarks.discovery import hiding
from tools.benchmarks.discovery.answers import Answer, ask
from tools.benchmarks.wave_recordings import OUR_PROGRAM

Hiding = TypeVar("Hiding")
Hidden = TypeVar("Hidden", bound=Labelled)
Scored = TypeVar("Scored", bound=Labelled)


@dataclass(frozen=True)
class Asking(Generic[Hiding]):
    """What to hide, on how many processes, where all goes, and whom to ask: a program with a verb `discover`."""

    plan: Hiding
    workers: int
    out: Path
    program: tuple[str, ...] = OUR_PROGRAM

    @property
    def hidden(self) -> Path:
        """Folder of what is sealed, and of recordings while they are asked about."""
        return self.out / "hidden"

    @property
    def campaign(self) -> Campaign:
        """On its processes, kept in its folder."""
        return Campaign(self.out, self.workers)


@dataclass(frozen=True)
class Question:
    """A case to ask about: its label and the model it is asked with are all that is known of it.

    choose: of several effects that are tied the first is chosen.
    """

    label: str
    asking: Asking[Any]
    model: Path = NOMINAL_INJECTOR
    choose: bool = True


@dataclass(frozen=True)
class Answered(Generic[Hidden]):
    """A case, opened, its answer and the model that was given."""

    case: Hidden
    answer: Answer
    model: Path

    @property
    def label(self) -> str:
        """Of the case."""
        return self.case.label


def generate(cases: str, verb: str, folder: Path, *arguments: str, given: str = "") -> tuple[Path, ...]:
    """Run what hides the cases of a module, the only process that knows them before the answers are in; its files."""
    command = [sys.executable, "-m", hiding.__name__, cases, verb, str(folder), *arguments]
    done = subprocess.run(command, input=given, stdout=subprocess.PIPE, text=True, check=True)
    return tuple(Path(line) for line in done.stdout.splitlines())


def seal(plan: Any, folder: Path) -> None:
    """Have the cases of a plan drawn by the module it is of."""
    generate(type(plan).__module__, "seal", folder, given=json.dumps(asdict(plan)))


def recorded(question: Question) -> tuple[Path, ...]:
    """Have a case recorded in a folder of its own; the files."""
    hidden, label = question.asking.hidden, question.label
    return generate(type(question.asking.plan).__module__, "record", hidden, label, str(hidden / label))


def ask_question(question: Question) -> Answer:
    """Work of one process: have a case recorded, and ask. Its findings stay in `out`, nothing else."""
    label, asking, recordings = question.label, question.asking, recorded(question)
    answer = asking.out / "asked" / label
    try:
        found = ask(asking.program, label, recordings, answer, question.model, question.choose)
        kept = asking.out / "findings" / f"{label}.json"
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(answer / "findings.json", kept)
        return found
    finally:
        for folder in (recordings[0].parent, answer):
            shutil.rmtree(folder, ignore_errors=True)


def ask_and_score(
    campaign: Campaign,
    questions: Sequence[Question],
    answers: Store[Answer],
    opened: Callable[[], Iterable[Hidden]],
    score: Callable[[Answered[Hidden]], Scored],
    results: Store[Scored],
) -> Found[Scored]:
    """Results in the order of the questions; opened when all answers are in. What is stored is not asked again."""
    given = campaign.results("answers", answers, ask_question, questions)
    models = {question.label: question.model for question in questions}
    answered = [Answered(c, given[c.label], models[c.label]) for c in opened() if c.label in given]
    scored = campaign.results("scores", results, score, answered)
    return campaign.found(questions, scored)
