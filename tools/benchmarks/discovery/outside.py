"""Outside the vocabulary: effects no name is for, or whose name was taken away, and the terms `discover` proposes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from observer_rt.foundation.errors import RunError
from tools.benchmarks.campaign import Bar, How, Row, tally
from tools.benchmarks.discovery import kinds
from tools.benchmarks.discovery.answers import CONFIDENT, NAMED, calibration, calibration_error
from tools.benchmarks.discovery.cases import HiddenCase, Query, outside_benches, taken_away
from tools.benchmarks.discovery.laws import ALL_KINDS, VOCABULARY_KINDS
from tools.benchmarks.discovery.outside_answers import OutsideAnswer, ask_outside
from tools.benchmarks.discovery.rigs import FURTHER, GIVEN
from tools.benchmarks.discovery.scoring import measured

CASES = 150
HALVED = 0.5
SAME_FLOW = 0.05  # share of a flow, within which a law of two inputs is as good as the true one
MEANINGFUL_MASS_MG = 0.3
WORSE_MG, WORSE_SHARE = 0.1, 0.2  # by both of which a mass must be further off to count as worse


def score_outside(case: HiddenCase, model: Path | str) -> Row:
    """Record a case, ask with a model, and judge the answer. Raises RunError without a model."""
    if isinstance(model, str):
        raise RunError(model)
    recorded = measured(outside_benches(case, GIVEN), case.with_rate)
    further, healthy = (measured(outside_benches(each, FURTHER, 0.0)) for each in (case, replace(case, parts=())))
    return facts_of(case, ask_outside(recorded, further, healthy, model, taken_away(case)))


def facts_of(case: HiddenCase, answer: OutsideAnswer) -> Row:
    hidden, best = case.asked is not Query.HEALTHY, answer.best
    kind = ALL_KINDS[case.name] if hidden else None
    right_equations = kind.equations(case.with_rate) if kind else frozenset()
    proposed = frozenset[kinds.TermEquation]()
    if best is not None:
        of_effects = (VOCABULARY_KINDS[name].equation for name in best.effects)
        proposed = frozenset((*map(kinds.TermEquation, best.equations), *of_effects))
    accepted, after = best is not None and best.may_enter, answer.named if best is None else best.misfit
    pressure_halved = after.pressure_mpa <= HALVED * answer.before.pressure_mpa
    before_mg, after_mg = (each.mass_mg - answer.own.mass_mg for each in (answer.before, after))
    mass_halved = after_mg <= HALVED * before_mg if before_mg > MEANINGFUL_MASS_MG else None
    worse_mg = after.mass_mg - answer.before.mass_mg
    worse = accepted and worse_mg > WORSE_MG and after.mass_mg > (1.0 + WORSE_SHARE) * answer.before.mass_mg
    is_named, of_law = answer.verdict == NAMED, case.asked in (Query.OUTSIDE, Query.PRODUCT)
    wrong = (
        is_named and answer.confidence >= CONFIDENT and any(not kinds.near_tie(n, case.name) for n in answer.claims)
    )
    rightly_named = len(answer.by_vocabulary) == 1 and kinds.near_tie(answer.by_vocabulary[0], case.name)
    right_equation = bool(proposed) and proposed <= right_equations
    right_inputs = best is not None and kind is not None and best.inputs == kind.inputs
    is_product = case.asked is Query.PRODUCT
    as_good = (right_equation or (is_named and not wrong and best is None)) and pressure_halved
    marks = {
        "WRONG NAME, AND SURE": wrong,
        "MASS WORSE": worse,
        "NOT AS GOOD": case.asked is Query.LEFT_OUT and not as_good,
        "NEEDLESS": best is not None and (not hidden or (case.asked is Query.SINGLE and rightly_named)),
        "WRONG EQUATION": of_law and not right_equation,
        "WRONG INPUTS": is_product and not right_inputs,
        "GAP": of_law and (not pressure_halved or mass_halved is False),
    }
    right, wrong_odds = 0.0, []  # right are all that cannot be told from what is hidden
    for odds, names, equations, inputs in answer.stated:
        if _is_right(names, frozenset(map(kinds.TermEquation, equations)), inputs, case, right_equations):
            right += odds
        else:
            wrong_odds.append(-odds)
    return {
        "hidden": case.name,
        "text": case.text,
        "asked": case.asked,
        "in_library": kind.in_library if kind else None,
        "said": f"{answer.verdict} {'+'.join(answer.claims)}".strip(),
        "confidence": answer.confidence,
        "confidences": [right, *wrong_odds] if right else wrong_odds,
        "proposal": f"{best.text}{'' if best.may_enter else ', refused'}" if best else "nothing",
        "proposed": best is not None,
        "accepted": accepted,
        "right_equation": right_equation if hidden else None,
        "own_equation": kind.equation in proposed if kind else None,
        "right_inputs": right_inputs if is_product else None,
        "right_law": right_equation or after.flow <= SAME_FLOW if is_product else None,
        "flow_off": after.flow if is_product else None,
        "rightly_named": rightly_named,
        "as_good": as_good if case.asked is Query.LEFT_OUT else None,
        "pressure_before": answer.before.pressure_mpa,
        "pressure_named": answer.named.pressure_mpa,
        "pressure_after": after.pressure_mpa,
        "pressure_halved": pressure_halved,
        "mass_before": answer.before.mass_mg,
        "mass_after": after.mass_mg,
        "mass_halved": mass_halved,
        "accepted_worse": worse,
        "wrong_and_sure": wrong or (is_product and min(wrong_odds, default=0.0) <= -CONFIDENT),
        "core_seconds": answer.core_seconds,
        "marks": ", ".join(mark for mark, holds in marks.items() if holds),
    }


def _is_right(
    names: Sequence[str], laws: kinds.Family, inputs: frozenset[str], case: HiddenCase, right: kinds.Family
) -> bool:
    """Whether an explanation is of the hidden effect, by name, or by laws of its equation; of a healthy case none.

    Beside laws a name stands for its equation, as in a proposal. A law of two inputs must go by these.
    """
    if case.asked is Query.HEALTHY or not (laws or names):
        return case.asked is Query.HEALTHY and not (laws or names)
    if case.asked is Query.PRODUCT and inputs != ALL_KINDS[case.name].inputs:
        return False
    if laws:
        return laws.union(VOCABULARY_KINDS[name].equation for name in names) <= right
    return all(kinds.near_tie(name, case.name) for name in names)


def misses(frame: pd.DataFrame) -> list[str]:
    return [
        f"{row.text}: {row.said} ({row.confidence:.2f}), proposed {row.proposal}; "
        f"p_L {row.pressure_before:.2f} to {row.pressure_after:.2f} MPa, "
        f"mass {row.mass_before:.2f} to {row.mass_after:.2f} mg; {row.marks}"
        for row in (frame[frame["marks"].fillna("") != ""] if "marks" in frame else frame[:0]).itertuples()
    ]


def bars(tier: str) -> Sequence[Bar]:
    index, of_library, of_two = "AB".index(tier), "asked == 'outside' and in_library == {}", "asked == 'product'"
    at_least = (
        ("right_equation_in_library", of_library.format(True), "right_equation", 0.95, 0.85),
        ("right_equation_not_in_library", of_library.format(False), "right_equation", 0.80, 0.65),
        ("pressure_halved_in_library", of_library.format(True), "pressure_halved", 0.95, 0.80),
        ("pressure_halved_not_in_library", of_library.format(False), "pressure_halved", 0.85, 0.75),
        ("mass_halved_in_library", of_library.format(True), "mass_halved", 0.90, 0.75),
        ("mass_halved_not_in_library", of_library.format(False), "mass_halved", 0.75, 0.60),
        ("left_out_as_good", "asked == 'left_out'", "as_good", 0.85, 0.70),
        ("product_right_inputs", of_two, "right_inputs", 0.85, 0.85),
        ("product_right_law", of_two, "right_law", 0.70, 0.70),
        ("product_accepted", of_two, "accepted", 0.85, 0.85),
    )
    at_most = (
        ("accepted_mass_worse", "accepted == True", "accepted_worse", 0.02, 0.04),
        ("wrong_and_sure", "", "wrong_and_sure", 0.03, 0.05),
        ("proposed_to_healthy", "asked == 'healthy'", "proposed", 0.0, 0.02),
        ("proposed_to_rightly_named", "asked == 'single' and rightly_named == True", "proposed", 0.03, 0.06),
        ("product_mass_worse", of_two, "accepted_worse", 0.0, 0.0),
        ("product_wrong_and_sure", of_two, "wrong_and_sure", 0.0, 0.0),
    )
    return [
        *(Bar(name, column, "mean", least=limits[index], of=of) for name, of, column, *limits in at_least),
        *(Bar(name, column, "mean", most=limits[index], of=of) for name, of, column, *limits in at_most),
        Bar("confidence_calibration_error", "confidences", calibration_error, most=0.05),
        Bar("confidence_bin_off_max", "confidences", lambda said: float(calibration(said)["off"].max()), most=0.07),
        Bar("core_seconds_max", "core_seconds", "max", most=(10.0, 20.0)[index]),
    ]


COLUMNS: dict[str, tuple[str, How]] = {
    "in library": ("in_library", "of"),
    "right equation": ("right_equation", "of"),
    "its own": ("own_equation", "of"),
    "right inputs": ("right_inputs", "of"),
    "right law": ("right_law", "of"),
    "flow off": ("flow_off", "max"),
    "proposed": ("proposed", "of"),
    "accepted": ("accepted", "of"),
    "as good": ("as_good", "of"),
    "p_L off, MPa": ("pressure_before", "median"),
    "by name": ("pressure_named", "median"),
    "p_L after": ("pressure_after", "median"),
    "p_L halved": ("pressure_halved", "of"),
    "mass off, mg": ("mass_before", "median"),
    "mass after": ("mass_after", "median"),
    "mass halved": ("mass_halved", "of"),
    "worse": ("accepted_worse", "sum"),
    "of a core": ("core_seconds", "median"),
    "answered": ("said", tally),
}
