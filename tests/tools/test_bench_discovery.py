"""What the discovery benchmark makes of answers: its definitions by hand-made cases, and a run with a stub to ask."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.model.effects import VOCABULARY
from tests.observed_plants import recording_of
from tests.plants.plant import record
from tests.tools.discovery_stub import Stub, printed
from tools.benchmarks.discovery import result as summary
from tools.benchmarks.discovery.answers import Answer, read_answer
from tools.benchmarks.discovery.asking import Answered, Asking
from tools.benchmarks.discovery.cases import GIVEN, HiddenCase, HidingPlan, make_case, without_noise
from tools.benchmarks.discovery.figures import save_figures
from tools.benchmarks.discovery.hidden import HEALTHY, HIDDEN
from tools.benchmarks.discovery.result import CaseResult, Gap, Grade, Interval, Visibility
from tools.benchmarks.discovery.run import run_discovery, shown
from tools.benchmarks.discovery.scoring import injector_of, open_loop, score_answered
from tools.benchmarks.discovery.tables import json_document, misses

VISIBLE = Visibility(gain=500.0, mass_mg=1.0, pressure_mpa=0.0, beyond_dead_zone=True)
RIGHT = CaseResult(
    label="0",
    effect="seat_area",
    values=(0.1,),
    with_rate=False,
    verdict="named",
    claims=(("seat_area", 0.95),),
    listed=("seat_area",),
    visibility=VISIBLE,
    rivalry=(),
    intervals=(Interval("v_S", 0.05, 0.15, 0.1),),
    line_pressure=None,
    injected_mass=Gap(before=1.02, after=0.04, oracle=0.02),
    seconds=3.0,
    core_seconds=4.0,
)
WRONG = replace(RIGHT, claims=(("lift_gain", 0.9),), listed=("lift_gain",), intervals=())
AMBIGUOUS = replace(
    RIGHT,
    verdict="ambiguous",
    claims=(("seat_area", 0.5), ("lift_gain", 0.5)),
    listed=("seat_area", "lift_gain"),
    rivalry=(("lift_gain", 3.0),),
    intervals=(),
)
HEALTHY_RIGHT = replace(
    RIGHT, effect=HEALTHY, values=(), verdict="none", claims=(), listed=(), visibility=None, intervals=(),
    injected_mass=None,
)  # fmt: skip


@pytest.mark.parametrize(
    ("visibility", "above"),
    [
        (VISIBLE, True),
        (replace(VISIBLE, gain=49.0), False),
        (replace(VISIBLE, mass_mg=0.29), False),
        (replace(VISIBLE, mass_mg=0.0, pressure_mpa=0.3), True),
        (replace(VISIBLE, beyond_dead_zone=False), False),
    ],
)
def test_above_noise_is_seen_relevant_and_beyond_the_dead_zone(visibility: Visibility, above: bool) -> None:
    assert visibility.above_noise is above


@pytest.mark.parametrize(
    ("result", "grade"),
    [
        (RIGHT, Grade.RIGHT),
        (WRONG, Grade.WRONG),
        (replace(RIGHT, claims=(*RIGHT.claims, *WRONG.claims)), Grade.WRONG),
        (replace(RIGHT, verdict="unknown", claims=()), Grade.WRONG),
        (replace(RIGHT, effect="line_volume", claims=(("bulk_modulus", 0.9),)), Grade.RIGHT),
        (AMBIGUOUS, Grade.AMBIGUOUS),
        (replace(RIGHT, visibility=replace(VISIBLE, gain=49.0)), Grade.NOT_LOOKED_FOR),
        (replace(WRONG, visibility=replace(VISIBLE, gain=49.0)), Grade.NOT_LOOKED_FOR),
        (replace(AMBIGUOUS, rivalry=(("lift_gain", 16.5),)), Grade.WRONG),
        (replace(AMBIGUOUS, rivalry=(("lift_gain", -16.5),)), Grade.WRONG),
        (replace(AMBIGUOUS, effect="channel_skew", rivalry=()), Grade.WRONG),
        (HEALTHY_RIGHT, Grade.RIGHT),
        (replace(HEALTHY_RIGHT, verdict="ambiguous"), Grade.WRONG),
        (replace(HEALTHY_RIGHT, verdict="named", claims=(("seat_area", 0.5),)), Grade.WRONG),
    ],
)
def test_answers_are_graded(result: CaseResult, grade: Grade) -> None:
    assert result.grade is grade
    assert result.right is (grade in (Grade.RIGHT, Grade.AMBIGUOUS)) or grade is Grade.NOT_LOOKED_FOR


def test_detection_limit_parts_found_from_not_found() -> None:
    def cases(sizes: list[float], found: list[bool]) -> list[CaseResult]:
        return [replace(RIGHT if f else WRONG, values=(-s,)) for s, f in zip(sizes, found, strict=True)]

    sizes = [0.8, 0.01, 0.02, 0.04, 0.1, 0.2]
    assert summary.detection_limit(cases(sizes, [True, False, False, True, True, True])) == pytest.approx(
        math.sqrt(0.02 * 0.04)
    )
    assert summary.detection_limit(cases(sizes, [True, False, True, False, True, True])) == pytest.approx(
        math.sqrt(0.01 * 0.02)
    )
    assert summary.detection_limit(cases(sizes, [True] * 6)) == 0.01
    assert summary.detection_limit(cases(sizes, [False] * 6)) is None


def test_calibration_error_is_the_mean_distance_of_confidence_and_right_share() -> None:
    sure = [replace(RIGHT, claims=(("seat_area", 0.96),))] * 9 + [
        replace(WRONG, claims=(("lift_gain", 0.96),))
    ]
    assert summary.calibration_error(sure) == pytest.approx(0.06)
    unsure = [AMBIGUOUS] * 5  # one of two names right each
    assert summary.calibration_error(unsure) == pytest.approx(0.0)
    assert summary.calibration_error(sure + unsure) == pytest.approx(0.06 * 10 / 20)
    assert summary.calibration_error([HEALTHY_RIGHT]) is None


def test_confidence_at_twice_the_limit_counts_a_wrong_name_as_none() -> None:
    cases = [replace(WRONG, values=(0.01,)), replace(RIGHT, values=(0.04,)), replace(WRONG, values=(0.041,))]
    cases += [replace(RIGHT, values=(s,)) for s in (0.042, 0.5, 0.6)]
    cases += [replace(AMBIGUOUS, values=(0.043,))]
    assert summary.confidences_at_twice_the_limit(cases) == [0.95, 0.0, 0.95]


def test_missed_bars_are_said() -> None:
    assert list(summary.violations([RIGHT] * 40 + [HEALTHY_RIGHT] * 40)) == []
    late = replace(RIGHT, intervals=(Interval("v_S", 0.2, 0.3, 0.1),))
    false_alarm = replace(HEALTHY_RIGHT, verdict="named", claims=(("seat_area", 0.99),))
    lines = summary.violations([late] * 30 + [WRONG] * 10 + [HEALTHY_RIGHT] * 9 + [false_alarm])
    assert [line.split(":")[0] for line in lines] == [
        "right or rightly ambiguous",
        "healthy, named anything",
        "seat_area",
        "calibration error of the confidence",
    ]
    slow = replace(RIGHT, seconds=15.1)
    assert list(summary.violations([slow])) == ["seconds without measured rate: 15.1 > 15"]
    assert list(summary.violations([replace(slow, with_rate=True)])) == []


def test_json_has_the_agreed_figures_and_tells_what_was_missed(tmp_path: Path) -> None:
    results = [RIGHT, replace(WRONG, label="bad"), AMBIGUOUS, HEALTHY_RIGHT]
    document = json.loads(json.dumps(json_document(results, ["x failed"])))
    figures = document["figures"]
    assert {
        "cases", "named_right_share", "false_alarm_share", "ambiguous_share", "unknown_right_share",
        "pairs_right_share", "tier_b_right_share", "gap_vs_oracle_median", "confidence_calibration_error",
        "seconds_max",
    } <= set(figures)  # fmt: skip
    assert figures["named_right_share"] == pytest.approx(1 / 3)
    assert figures["ambiguous_share"] == pytest.approx(1 / 3)
    assert figures["false_alarm_share"] == 0.0
    assert figures["seconds_max"] == 3.0
    assert document["details"]["crashes"] == ["x failed"]
    (miss,) = misses(results)
    assert miss.startswith("bad: seat_area v_S 0.1: named lift_gain (0.90)")
    assert {path.name for path in save_figures(results, tmp_path)} == {
        "confusion.png", "detection_limits.png", "reliability.png", "interval_coverage.png", "gap_left.png",
    }  # fmt: skip


def findings_of(case: HiddenCase) -> dict[str, Any]:
    """What `findings.json` says if it is right, within 1 % of the truth."""
    parameters = {
        p.name: {"value": v / p.si, "ci95": sorted((v / p.si * 0.99, v / p.si * 1.01)), "unit": p.unit}
        for p, v in zip(VOCABULARY[case.effect].parameters, case.values, strict=True)
    }
    effect = {"id": case.effect, "parameters": parameters, "confidence": 0.9, "indistinguishable_from": []}
    return {"verdict": "named", "effects": [effect]}


def amended_model_of(findings: dict[str, Any]) -> str:
    """The nominal injector file with the effects of findings in force."""
    text = NOMINAL_INJECTOR.read_text()
    for effect in findings["effects"]:
        values = ", ".join(
            f'{name} = {{ value = {p["value"]!r}, ci95 = {p["ci95"]!r}, unit = "{p["unit"]}" }}'
            for name, p in effect["parameters"].items()
        )
        text += f'\n[[effects]]\nid = "{effect["id"]}"\nparameters = {{ {values} }}\n'
        text += 'origin = "test"\nevidence = "none"\ndate = "2026-01-01"\n'
    return text


def answer_to(case: HiddenCase, findings: dict[str, Any]) -> Answer:
    return read_answer(case.label, findings, amended_model_of(findings), 1.0, 1.0)


@pytest.mark.parametrize(
    ("effect", "number"),
    [("orifice_area", 0), ("lift_offset", 1), ("channel_skew", 1), ("fuel_density", 0), ("seat_outflow", 0)],
)
def test_the_true_effect_in_force_closes_the_gap(effect: str, number: int) -> None:
    case = make_case(effect, False, 1, number)
    result = score_answered(Answered(case, answer_to(case, findings_of(case)), NOMINAL_INJECTOR))
    assert result.named_right
    assert result.above_noise
    assert len(result.intervals) == len(case.values)
    assert all(interval.holds for interval in result.intervals)
    assert result.line_pressure is not None
    assert result.injected_mass is not None
    for gap in (result.line_pressure, result.injected_mass):
        assert gap.after < gap.oracle + 0.01  # MPa, mg: steps and holds of two integrators
    assert max(result.line_pressure.before, result.injected_mass.before) > 0.3


def test_a_wrong_effect_leaves_the_gap() -> None:
    case = make_case("orifice_area", False, 1, 0)
    lag = make_case("line_pressure_sensor_lag", False, 1, 2)
    result = score_answered(Answered(case, answer_to(case, findings_of(lag)), NOMINAL_INJECTOR))
    assert not result.right
    assert result.intervals == ()
    assert result.injected_mass is not None
    assert result.injected_mass.share_left == pytest.approx(1.0, abs=0.01)


def test_terms_of_an_amended_model_are_in_force() -> None:
    (bench,) = without_noise(make_case(HEALTHY, False, 1, 0), GIVEN[3:4])
    recording, nominal = recording_of(record(bench)), NOMINAL_INJECTOR.read_text()
    term = injector_of(f'{nominal}\n[[terms]]\nequation = "nozzle_flow"\nlaw = "0.1"\n')
    effect = injector_of(
        amended_model_of(findings_of(replace(make_case("orifice_area", False, 1, 0), values=(0.1,))))
    )
    (line, mass), (there, same) = (open_loop(injector, recording) for injector in (term, effect))
    np.testing.assert_allclose(line, there, atol=1e3)
    np.testing.assert_allclose(mass, same, atol=1e-5)
    assert np.sum(mass) > 1.05 * np.sum(open_loop(injector_of(nominal), recording)[1])


def test_an_exact_equivalent_counts_with_its_own_size() -> None:
    case = next(c for n in range(20) if (c := make_case("line_volume", False, 1, n)).values[0] < -0.02)
    stiffer = 1.0 / (1.0 + case.values[0]) - 1.0
    findings = findings_of(replace(case, effect="bulk_modulus", values=(stiffer,)))
    result = score_answered(Answered(case, answer_to(case, findings), NOMINAL_INJECTOR))
    assert result.named_right
    assert [interval.holds for interval in result.intervals] == [True]
    assert max(summary.worst_gap_shares([result])) < 0.05


@pytest.mark.slow
def test_a_run_asks_once_scores_all_and_goes_on_where_it_stopped(tmp_path: Path) -> None:
    stub = Stub(tmp_path)
    asking = Asking(HidingPlan(("seat_outflow",), 1, 1, (True,), 1), 1, tmp_path / "out", stub.program)
    found = run_discovery(asking)
    assert found.crashes == ()
    outflow, healthy = sorted(found.results, key=lambda r: r.effect, reverse=True)
    assert (outflow.effect, outflow.above_noise, outflow.right) == ("seat_outflow", True, False)
    assert (healthy.effect, healthy.right) == (HEALTHY, True)
    assert outflow.line_pressure is not None
    assert outflow.line_pressure.share_left == pytest.approx(1.0)
    calls = stub.calls()
    asked = [recordings for _, _, recordings, commas in calls if (len(recordings), commas) == (6, 4)]
    assert len(asked) == 2
    assert not any(effect in path for paths in asked for path in paths for effect in HIDDEN)
    assert not any(Path(path).exists() for paths in asked for path in paths)

    again = run_discovery(replace(asking, plan=replace(asking.plan, healthy=2)))
    assert len(stub.calls()) == len(calls) + 1
    assert [r for r in again.results if r in found.results] == list(found.results)
    assert f"missed: {outflow.label} with rate: seat_outflow: none" in printed(shown(again))


@pytest.mark.slow
def test_a_case_that_fails_is_said_and_the_others_go_on(tmp_path: Path) -> None:
    stub = Stub(tmp_path, fails_once=True)
    asking = Asking(HidingPlan((), 0, 2, (False,), 1), 1, tmp_path / "out", stub.program)
    found = run_discovery(asking)
    assert [r.right for r in found.results] == [True]
    assert len(found.crashes) == 1
    assert "no luck" in found.crashes[0]
    assert [r.right for r in run_discovery(asking).results] == [True, True]
