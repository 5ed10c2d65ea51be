"""What the discovery benchmark makes of answers: its definitions by hand-made ones, and cases with a stub to ask."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.foundation.errors import RunError
from observer_rt.model.effects import VOCABULARY
from tools.benchmarks.campaign import Row
from tools.benchmarks.discovery import answers, nominal, real_line, scoring
from tools.benchmarks.discovery.answers import Answer, Grade, calibration, calibration_error
from tools.benchmarks.discovery.cases import SERVO_HIDDEN, HiddenCase, Query, nominal_cases, real_case, servo_cases
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.discovery.rigs import GIVEN, Rig
from tools.benchmarks.discovery.scoring import gaps
from tools.benchmarks.discovery.vocabulary import EFFECTS, HIDDEN, Parts

SEEN = {"gain": 500.0, "mass_mg": 1.0, "pressure_mpa": 0.0, "beyond": True}
PAIR = ["bulk_modulus", "guide_leakage"]
RIG = Rig(Discrepancy.TAPER, False, 1)


def answer(verdict: str, *names: str, confidence: float = 0.95, others: Sequence[str] = (), **more: Any) -> Answer:
    """An answer that names effects, each with a confidence and the effects it cannot be distinguished from."""
    claims = tuple({"id": n, "confidence": confidence, "indistinguishable_from": [*others]} for n in names)
    stated: dict[str, Any] = {"smallest": (), "amended_model": "", "core_seconds": 4.0, **more}
    return Answer(verdict, claims, **stated)


def hidden(name: str, size: float = 0.1) -> HiddenCase:
    parts: Parts = ((name, (size,)),) if name else ()
    return HiddenCase("0", Query.SINGLE if name else Query.HEALTHY, parts, False, None, 1)


@pytest.mark.parametrize(
    ("seen", "above"),
    [
        (SEEN, True),
        (SEEN | {"gain": 49.0}, False),
        (SEEN | {"mass_mg": 0.29}, False),
        (SEEN | {"mass_mg": 0.0, "pressure_mpa": 0.3}, True),
        (SEEN | {"beyond": False}, False),
    ],
)
def test_what_is_seen_relevant_and_beyond_the_dead_zone_must_be_named(seen: Row, above: bool) -> None:
    row = nominal.facts_of(hidden("seat_area"), answer("none"), seen, {})
    assert row["above"] is above
    assert row["grade"] is (Grade.WRONG if above else Grade.NOT_LOOKED_FOR)


@pytest.mark.parametrize(
    ("name", "said", "rival", "grade"),
    [
        ("seat_area", answer("named", "seat_area"), 0.0, Grade.RIGHT),
        ("seat_area", answer("named", "lift_gain"), 0.0, Grade.WRONG),
        ("seat_area", answer("named", "seat_area", "lift_gain"), 0.0, Grade.WRONG),
        ("seat_area", answer("unknown"), 0.0, Grade.WRONG),
        ("line_volume", answer("named", "bulk_modulus"), 0.0, Grade.RIGHT),
        ("seat_area", answer("ambiguous", "seat_area", "lift_gain"), 3.0, Grade.AMBIGUOUS),
        ("lift_gain", answer("ambiguous", "seat_area", others=("lift_gain",)), 3.0, Grade.AMBIGUOUS),
        ("seat_area", answer("ambiguous", "seat_area", "lift_gain"), 16.5, Grade.WRONG),
        ("seat_area", answer("ambiguous", "seat_area", "lift_gain"), -16.5, Grade.WRONG),
        ("channel_skew", answer("ambiguous", "seat_area", "lift_gain"), 0.0, Grade.WRONG),
        ("", answer("none"), 0.0, Grade.RIGHT),
        ("", answer("ambiguous", "seat_area"), 0.0, Grade.WRONG),
        ("", answer("named", "seat_area", confidence=0.5), 0.0, Grade.WRONG),
    ],
)
def test_answers_of_tier_a_are_graded(name: str, said: Answer, rival: float, grade: Grade) -> None:
    row = nominal.facts_of(hidden(name), said, SEEN if name else {}, {"lift_gain": rival})
    assert row["grade"] is grade
    assert row["right"] is (grade is not Grade.WRONG)


def test_calibration_is_the_distance_of_confidence_and_right_share() -> None:
    sure, unsure = [0.96] * 9 + [-0.96], [0.5, -0.5] * 5
    assert calibration_error(pd.Series(sure)) == pytest.approx(0.06)
    assert calibration_error(pd.Series(unsure)) == pytest.approx(0.0)
    assert calibration_error(pd.Series(sure + unsure)) == pytest.approx(0.06 * 10 / 20)
    low, high = calibration(pd.Series(sure))[["low", "high"]].iloc[0]
    assert low < 0.9 < high
    assert low == pytest.approx(0.61, abs=0.01)


def findings_of(parts: Parts) -> list[Row]:
    """Effects of a `findings.json` that is right, within 1 % of the truth."""
    return [
        {
            "id": name,
            "parameters": {
                p.name: {"value": v / p.si, "ci95": sorted((v / p.si * 0.99, v / p.si * 1.01)), "unit": p.unit}
                for p, v in zip(VOCABULARY[name].parameters, values, strict=True)
            },
            "confidence": 0.95,
            "indistinguishable_from": [],
        }
        for name, values in parts
    ]


def amended_model_of(parts: Parts) -> str:
    text = NOMINAL_INJECTOR.read_text()
    for effect in findings_of(parts):
        values = ", ".join(
            f'{name} = {{ value = {p["value"]!r}, ci95 = {p["ci95"]!r}, unit = "{p["unit"]}" }}'
            for name, p in effect["parameters"].items()
        )
        text += f'\n[[effects]]\nid = "{effect["id"]}"\nparameters = {{ {values} }}\n'
        text += 'origin = "test"\nevidence = "none"\ndate = "2026-01-01"\n'
    return text


def answering(monkeypatch: pytest.MonkeyPatch, module: Any, parts: Parts) -> None:
    """Have a campaign ask one who names these effects, and check the request."""

    def ask(recordings: Sequence[Path], folder: Path, model: Path, choose: bool) -> Answer:
        request = " ".join(map(str, (*recordings, folder, model)))
        assert not any(name in request for name in (*HIDDEN, *EFFECTS, *Discrepancy, *Query))
        assert len(recordings) == len(GIVEN)
        return Answer("named", tuple(findings_of(parts)), (), amended_model_of(parts), 1.0)

    monkeypatch.setattr(module, "ask", ask)


@pytest.mark.parametrize(
    ("effect", "number"),
    [
        *(("orifice_area", 0), ("lift_offset", 1), ("channel_skew", 1), ("fuel_density", 0)),
        *(("seat_outflow", 0), ("line_pressure_sensor_lag", 3)),
    ],
)
def test_the_true_effect_in_force_closes_the_gap(monkeypatch: pytest.MonkeyPatch, effect: str, number: int) -> None:
    case = nominal_cases([effect], number + 1, [False], 1)[number]
    answering(monkeypatch, nominal, case.parts)
    noted_gaps: list[tuple[list[float], ...]] = []

    def noted(*arguments: Any) -> tuple[list[float], ...]:
        noted_gaps.append(gaps(*arguments))
        return noted_gaps[-1]

    monkeypatch.setattr(scoring, "gaps", noted)
    row = nominal.score_nominal(case, NOMINAL_INJECTOR)
    assert row["grade"] is Grade.RIGHT
    assert row["held"] == [True] * len(case.parts[0][1])
    for _, after, _ in noted_gaps[0]:
        assert after < 0.03  # MPa, mg: steps and holds of two integrators
    assert max(before for before, _, _ in noted_gaps[0]) > 0.3


@pytest.mark.parametrize(
    ("names", "said", "grade"),
    [
        (["seat_area"], answer("named", "seat_area"), Grade.RIGHT),
        (["seat_area"], answer("named", "line_friction"), Grade.WRONG),
        (["seat_area"], answer("none"), Grade.WRONG),
        (["seat_area"], answer("named", "seat_area", "line_friction"), Grade.WRONG),
        (["seat_area"], answer("ambiguous", "seat_area", "lift_gain"), Grade.AMBIGUOUS),
        (["seat_area"], answer("ambiguous", "seat_area", "line_friction"), Grade.WRONG),
        (["seat_area"], answer("ambiguous", "lift_gain", "lift_offset"), Grade.WRONG),
        ([], answer("none"), Grade.RIGHT),
        ([], answer("ambiguous", "seat_area"), Grade.WRONG),
        (PAIR, answer("named", "line_volume", "guide_leakage"), Grade.RIGHT),
        (PAIR, answer("named", "guide_leakage"), Grade.WRONG),
        (PAIR, answer("named", "line_volume", "bulk_modulus"), Grade.WRONG),
        (PAIR, answer("ambiguous", "line_volume", "seat_area", "guide_leakage"), Grade.AMBIGUOUS),
        (PAIR, answer("ambiguous", "line_volume", "seat_area"), Grade.WRONG),
        (["lift_leakage"], answer("unknown"), Grade.RIGHT),
        (["lift_leakage"], answer("none"), Grade.WRONG),
        (["lift_leakage"], answer("named", "guide_leakage", confidence=0.5), Grade.WRONG),
    ],
)
def test_answers_of_tier_b_are_graded(names: list[str], said: Answer, grade: Grade) -> None:
    assert real_line.facts_of(real_case(names, RIG, 0), said)["grade"] is grade


def test_a_case_on_a_real_line_is_scored_with_the_model_of_its_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    case = real_case(["seat_area"], RIG, 0)
    answering(monkeypatch, answers, case.parts)
    row = real_line.score_real(case, NOMINAL_INJECTOR)
    assert (row["grade"], row["held"], row["adequate"]) == (Grade.RIGHT, [True], False)
    assert "MPa" in row["gaps"]
    with pytest.raises(RunError, match="no fit"):
        real_line.score_real(case, "no fit")


def test_tier_c_hides_everything_in_turn_in_injectors_with_a_pilot_valve(monkeypatch: pytest.MonkeyPatch) -> None:
    cases = servo_cases(2, 1)
    assert [case.name for case in cases] == [*SERVO_HIDDEN, *["healthy"] * 4] * 2
    plants = {(case.name, case.rig and case.rig.discrepancy) for case in cases}
    assert plants == {(name, plant) for name in (*SERVO_HIDDEN, "healthy") for plant in ("car", "heavy duty")}
    answering(monkeypatch, answers, cases[1].parts)
    row = real_line.score_real(cases[1], NOMINAL_INJECTOR)
    assert (row["grade"], row["accused"], row["wrong_and_sure"]) == (Grade.RIGHT, False, False)
    assert real_line.facts_of(cases[-1], answer("named", "seat_area"))["accused"]
    for equation, right in (("line_flow", True), ("needle_lift", False)):
        row = real_line.facts_of(cases[11], answer("unknown", equations=(equation,)))
        assert (row["grade"], row["right_equation"]) == (Grade.RIGHT, right)
