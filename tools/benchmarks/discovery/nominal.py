"""Tier A: effects hidden in plants of the nominal structure; an oracle with the true plant says which are visible."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from observer_rt.config.bench import load_injector
from observer_rt.model.effects import VOCABULARY
from tools.benchmarks.campaign import CHANCE, Bar, How, Row, chance_of_95, tally
from tools.benchmarks.discovery import scoring
from tools.benchmarks.discovery.answers import AMBIGUOUS, GRADES, NAMED, NONE, Answer, Grade, ask, calibration_error
from tools.benchmarks.discovery.cases import HiddenCase, nominal_benches
from tools.benchmarks.discovery.kinds import same_effect
from tools.benchmarks.discovery.rigs import FURTHER, GIVEN

CASES = 300
VISIBLE_GAIN = 50.0  # of the oracle's -2 log L
RELEVANT_MASS_MG, RELEVANT_PRESSURE_MPA = 0.3, 0.3  # an effect must move either by so much
INSEPARABLE = 16.0  # difference of the oracle's -2 log L below which two effects are not told apart
MEANINGFUL_GAP = 0.1  # MPa or mg; the share that is left of a smaller gap says nothing


def score_nominal(case: HiddenCase, model: Path) -> Row:
    with TemporaryDirectory(prefix="discovery-") as name:
        files = scoring.write_all(nominal_benches(case, GIVEN), case.with_rate, Path(name) / "given")
        answer = ask(files, Path(name) / "answer", model, choose=True)
    row = facts_of(case, answer, scoring.visibility(case) if case.parts else {}, scoring.rivalry(case, answer))
    if row["named_right"] and case.parts:
        row["held"] = scoring.held_intervals(case.parts, answer)
    if row["above"] and not VOCABULARY[case.name].remedy:  # effects with a remedy amend no model
        injector = load_injector(model)
        models = (injector, scoring.injector_of(answer.amended_model), scoring.with_effects(injector, case.parts))
        for name, (before, after, best) in zip(
            ("pressure_left", "mass_left"), scoring.gaps(nominal_benches(case, FURTHER, 0.0), models), strict=True
        ):
            row[name] = (after - best) / (before - best) if before - best >= MEANINGFUL_GAP else None
        left = [row[name] for name in ("pressure_left", "mass_left") if row[name] is not None]
        row["gap_left"] = max(left, default=None)
    return row


def facts_of(case: HiddenCase, answer: Answer, seen: Row, rivals: Mapping[str, float]) -> Row:
    """A case and its answer as a row; seen: the result of `visibility`, rivals: that of `rivalry`."""
    hidden = bool(case.parts)
    relevant = hidden and (seen["mass_mg"] >= RELEVANT_MASS_MG or seen["pressure_mpa"] >= RELEVANT_PRESSURE_MPA)
    above = relevant and seen["gain"] >= VISIBLE_GAIN and seen["beyond"]
    is_named = answer.verdict == NAMED and len(answer.names) == 1 and same_effect(answer.names[0], case.name)
    is_listed = any(same_effect(name, case.name) for name in answer.listed)
    is_open = answer.verdict == AMBIGUOUS and is_listed and all(abs(d) < INSEPARABLE for d in rivals.values())
    right = is_named or is_open if hidden else answer.verdict == NONE
    grade = Grade.AMBIGUOUS if hidden and is_open else Grade.RIGHT if right else Grade.WRONG
    return {
        "hidden": case.name,
        "text": case.text,
        "faulty": hidden,
        "with_rate": case.with_rate,
        **answer.facts(),
        **seen,
        "rivals": "".join(f", {name} {difference:+.0f}" for name, difference in rivals.items()),
        "above": above,
        "named_right": is_named,
        "left_open": is_open,
        "right": right,
        "alarm": not right,
        "grade": Grade.NOT_LOOKED_FOR if hidden and not above else grade,
        "confidences": answer.confidences(lambda name: same_effect(name, case.name)),
        "held": [],
    }


def misses(frame: pd.DataFrame) -> list[str]:
    wrong = frame[frame["grade"].eq(Grade.WRONG)] if "grade" in frame else frame[:0]
    return [f"{row.text}: {row.verdict} {row.claimed}{row.rivals}" for row in wrong.itertuples()]


BARS = (
    Bar("named_right_share", "named_right", "mean", of="above == True"),
    Bar("right_or_ambiguous_share", "right", "mean", least=0.97, of="above == True"),
    Bar("ambiguous_share", "left_open", "mean", of="above == True"),
    Bar("false_alarm_share", "alarm", "mean", most=0.01, of="not faulty"),
    Bar("coverage_chance_min", "held", chance_of_95, least=CHANCE, of="above == True", by="hidden"),
    Bar("interval_coverage_share", "held", "mean", 0.92, 0.98, of="above == True", from_values=100),
    Bar("confidence_calibration_error", "confidences", calibration_error, most=0.05),
    Bar("gap_vs_oracle_median", "gap_left", "median", most=0.05),
    Bar("gap_vs_oracle_p90", "gap_left", "p90", most=0.15),
    Bar("core_seconds_max", "core_seconds", "max"),
)
COLUMNS: dict[str, tuple[str, How]] = {
    **GRADES,
    "answered": ("answer", tally),
    "intervals hold": ("held", "of"),
    "p_L gap left": ("pressure_left", "median"),
    "p_L p90": ("pressure_left", "p90"),
    "mass gap left": ("mass_left", "median"),
    "mass p90": ("mass_left", "p90"),
    "of a core, max": ("core_seconds", "max"),
}
