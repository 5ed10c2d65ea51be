"""Tiers B and C: effects, pairs and what has no name hidden in plants that no model contains, to which `fit` fits."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from observer_rt.config.bench import load_injector
from observer_rt.foundation.errors import RunError
from tests.plants.real import Setting
from tools.benchmarks.campaign import Bar, How, Row, tally
from tools.benchmarks.discovery import answers, scoring
from tools.benchmarks.discovery.cases import FITTED_KINDS, HiddenCase, Query, real_benches
from tools.benchmarks.discovery.kinds import near_tie, same_effect
from tools.benchmarks.discovery.rigs import FURTHER, Rig, healthy_benches
from tools.benchmarks.fitting import fitted_model
from tools.benchmarks.real_injectors import real_model

CASES = 150
SURELY_VISIBLE = 3.0  # times the smallest visible size: from there on an effect must be named
TOLERANCES = (0.003, 0.02)  # MPa, mg, by which a gap may grow, or by GAP_TOLERANCE of it
GAP_TOLERANCE = 0.02


def model_of(rig: Rig, out: Path) -> Path | str:
    """The fitted injector file of a rig, or why `fit` failed."""

    def recorded(folder: Path) -> list[Path]:
        return scoring.write_all(healthy_benches(rig), rig.with_rate, folder / "healthy")

    try:
        if isinstance(rig.discrepancy, Setting):
            return real_model(rig.discrepancy, rig.seed, weighed=True, out=out / "rigs")
        return fitted_model(out / "rigs" / rig.name, recorded)
    except RunError as error:
        return str(error)


def score_real(case: HiddenCase, model: Path | str) -> Row:
    """Record a case, ask with the fitted model of its rig, and judge the answer. Raises RunError without a model."""
    if isinstance(model, str):
        raise RunError(model)
    assert case.rig is not None
    with TemporaryDirectory(prefix="discovery-") as name:
        files = scoring.write_all(real_benches(case, case.rig.points), case.with_rate, Path(name) / "given")
        answer = answers.ask(files, Path(name) / "answer", model, choose=False)
    row, fitted = facts_of(case, answer), load_injector(model)
    row["adequate"] = fitted.baseline is not None and fitted.baseline.adequate
    truth = scoring.in_terms_of(fitted, case)
    if row["named_right"]:
        row["held"] = scoring.held_intervals(truth, answer)
    is_amended = answer.verdict == answers.NAMED and answer.amended_model != model.read_text()
    if is_amended and not isinstance(case.rig.discrepancy, Setting):
        amended = scoring.injector_of(answer.amended_model)
        models = fitted, amended, scoring.with_effects(amended, truth)
        misfits = scoring.gaps(real_benches(case, FURTHER, 0.0), models)
        row["gap_larger"] = any(is_larger(gap, each) for gap, each in zip(misfits, TOLERANCES, strict=True))
        row["gaps"] = "; ".join(
            f"{before:.3f} to {after:.3f} {unit} (with the true sizes {true:.3f})"
            for (before, after, true), unit in zip(misfits, ("MPa", "mg"), strict=True)
        )
    return row


def is_larger(gap: Sequence[float], tolerance: float) -> bool:
    """Whether a gap grew by more than a tolerance in its unit, and by more than its share.

    gap: before, after, and with the true sizes, the best that naming can do: what the fitted model is off by may
    happen to cancel against an effect.
    """
    before, after, true = gap
    least = max(before, true)
    return after > least + max(tolerance, GAP_TOLERANCE * least)


def facts_of(case: HiddenCase, answer: answers.Answer) -> Row:
    """A case and its answer as a row, but for what the fitted model has to do with."""
    assert case.rig is not None
    effects, smallest = [name for name, _ in case.parts], scoring.smallest_visible(answer)
    names, is_named = answer.names, answer.verdict == answers.NAMED

    def is_hidden(name: str) -> bool:
        return any(same_effect(name, effect) for effect in effects)

    def has_all(named: Sequence[str]) -> bool:
        return all(any(same_effect(name, effect) for name in named) for effect in effects)

    named_right = is_named and len(names) == len(effects) and all(map(is_hidden, names)) and has_all(names)
    is_open = answer.verdict == answers.AMBIGUOUS and bool(effects) and has_all(answer.listed)
    if case.asked is Query.SINGLE:  # of one effect, beside its near ties only
        is_open = is_open and all(near_tie(name, effects[0]) for name in answer.listed)
    due = {Query.HEALTHY: answers.NONE, Query.OUTSIDE: answers.UNKNOWN}.get(case.asked)
    right = answer.verdict == due if due else named_right or is_open
    counted = bool(due) or all(
        abs(values[0]) >= SURELY_VISIBLE * smallest.get(name, 0.0) for name, values in case.parts
    )
    grade = answers.Grade.AMBIGUOUS if is_open else answers.Grade.RIGHT if right else answers.Grade.WRONG
    confidences = answer.confidences(is_hidden)
    equations = frozenset[str]().union(*(FITTED_KINDS[name].equations(case.with_rate) for name in effects))
    return {
        "hidden": case.name,
        "text": case.text,
        "kind": case.asked,
        "discrepancy": case.rig.discrepancy,
        **answer.facts(),
        "named_right": named_right,
        "counted": counted,
        "right": right,
        "right_equation": bool(answer.equations) and equations.issuperset(answer.equations),
        "grade": grade if counted else answers.Grade.NOT_LOOKED_FOR,
        "accused": case.asked is Query.HEALTHY and not right,
        "half_right": case.asked is Query.PAIR and not right and is_named and any(map(is_hidden, names)),
        "wrong_and_sure": is_named and any(each <= -answers.CONFIDENT for each in confidences),
        "confidences": confidences,
        "smallest": smallest.get(case.name),
        "named_size": abs(case.parts[0][1][0]) if named_right and len(effects) == 1 else None,
        "held": [],
        "gap_larger": False,
        "gaps": "",
    }


def misses(frame: pd.DataFrame) -> list[str]:
    if "grade" not in frame:
        return []
    wrong = frame["grade"].eq(answers.Grade.WRONG) | frame["wrong_and_sure"].eq(True) | frame["gap_larger"].eq(True)
    return [
        f"{row.text}: {row.verdict} {row.claimed} {'SURE ' * row.wrong_and_sure}{'GAP ' * row.gap_larger}{row.gaps}"
        for row in frame[wrong].itertuples()
    ]


SERVO_BARS = (
    Bar("right_share", "right", "mean", least=13 / 16, of="kind != 'healthy'"),
    Bar("healthy_accused", "accused", "sum", most=0),
    Bar("wrong_and_sure", "wrong_and_sure", "sum", most=0),
    Bar("laws_in_their_equation", "right_equation", "sum", of="kind == 'outside'"),
    Bar("core_seconds_max", "core_seconds", "max"),
)
_OF = "counted == True and kind == '{}'"
BARS = (
    Bar("healthy_right_share", "right", "mean", least=0.98, of=_OF.format("healthy")),
    Bar("named_right_share", "right", "mean", least=0.92, of=_OF.format("single")),
    Bar("pairs_right_share", "right", "mean", least=0.75, of=_OF.format("pair")),
    Bar("unknown_right_share", "right", "mean", least=0.95, of=_OF.format("outside")),
    Bar("healthy_accused_with_confidence", "wrong_and_sure", "sum", most=0, of="kind == 'healthy'"),
    Bar("wrong_and_sure", "wrong_and_sure", "sum"),
    Bar("pairs_half_right", "half_right", "sum", of="kind == 'pair'"),
    Bar("gap_larger", "gap_larger", "sum", most=0),
    Bar("coverage_share", "held", "mean", 0.90, 0.98, from_values=20),
    Bar("confidence_calibration_error", "confidences", answers.calibration_error, most=0.05),
    Bar("core_seconds_max", "core_seconds", "max", most=20.0),
)  # fmt: skip
COLUMNS: dict[str, tuple[str, How]] = {
    **answers.GRADES,
    "answered": ("answer", tally),
    "smallest visible, stated, SI": ("smallest", "median"),
    "smallest named": ("named_size", "min"),
    "intervals hold": ("held", "of"),
}
PLANT_COLUMNS: dict[str, tuple[str, How]] = {
    "fit adequate": ("adequate", "of"),
    **answers.GRADES,
    "wrong and sure": ("wrong_and_sure", "sum"),
    "gap larger": ("gap_larger", "sum"),
    "of a core, max": ("core_seconds", "max"),
}
