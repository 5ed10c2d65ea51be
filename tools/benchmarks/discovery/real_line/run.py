"""`tools/bench discovery --tier B`: hide, fit, ask, and, when all answers are in, open what was hidden and score."""

import shutil
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tools.benchmarks.discovery.answers import Answer, ask
from tools.benchmarks.discovery.asking import (
    WARM_UP_RECORDINGS,
    Asking,
    Found,
    Question,
    ask_and_score,
    seal,
)
from tools.benchmarks.discovery.real_line.cases import HIDING, RealPlan
from tools.benchmarks.discovery.real_line.fitting import HEALTHY, HIDING_SOURCES, fitted_models
from tools.benchmarks.discovery.real_line.result import RealResult, violations
from tools.benchmarks.discovery.real_line.scoring import score_answered
from tools.benchmarks.discovery.real_line.tables import discrepancy_table, effect_table, kind_lines, misses
from tools.benchmarks.report import Shown
from tools.benchmarks.runs import BENCHMARKS, PACKAGE


@dataclass(frozen=True)
class RealResults(Found[RealResult]):
    """adequate: what `fit` says of its model, by rig; a line for every fit that failed, too."""

    adequate: dict[str, bool]


def run_real_lines(asking: Asking[RealPlan]) -> RealResults:
    """Fit, and ask about the cases not yet asked about with this state of the code."""
    hidden, campaign, failed = asking.hidden, asking.campaign, list[str]()
    seal(asking.plan, hidden)
    labels = HIDING.labels_in(hidden)
    answers = campaign.store("answers", Answer, PACKAGE, *HIDING_SOURCES)
    results = campaign.store("results", RealResult, PACKAGE, BENCHMARKS)
    missing = {label.label for label in labels} - {answer.label for answer in answers.load()}
    models = fitted_models({label.rig for label in labels}, asking, failed)
    for rig in {label.rig for label in labels if label.label in missing} & models.keys():
        _warm_up(models[rig], asking.program)
    questions = [
        Question(one.label, asking, models[one.rig], choose=False) for one in labels if one.rig in models
    ]
    found = ask_and_score(
        campaign, questions, answers, lambda: HIDING.opened(hidden), score_answered, results
    )
    adequate = {
        rig.open_name: bool(tomllib.loads(model.read_text()).get("baseline", {}).get("adequate", False))
        for rig, model in models.items()
        if rig is not None
    }
    return RealResults(found.results, (*failed, *found.crashes), adequate)


def shown(found: RealResults) -> Iterator[Shown]:
    """The tables, then a line for every miss, every bar that is missed and every crash."""
    yield discrepancy_table(found.results, found.adequate)
    yield effect_table(found.results)
    yield from kind_lines(found.results)
    yield from (f"missed: {line}" for line in misses(found.results))
    yield from (f"bar missed: {line}" for line in violations(found.results, len(found.crashes)))
    yield from (f"crash: {line}" for line in found.crashes)


def _warm_up(model: Path, program: Sequence[str]) -> None:
    """Compile, or load from the cache, so that no case's seconds hold it: every line is compiled for itself."""
    folder = model.parent
    recordings, answer = sorted((folder / HEALTHY).glob("*.csv"))[:WARM_UP_RECORDINGS], folder / "warm-up"
    try:
        ask(program, "warm-up", recordings, answer, model, choose=False)
    except RuntimeError:  # a case will fail as well, and is told of
        return
    finally:
        shutil.rmtree(answer, ignore_errors=True)
