"""What tier B of discovery makes of answers: its definitions by hand-made cases, and runs with a stub to ask."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
from tests.tools.discovery_stub import Stub, printed
from tools.benchmarks.discovery.answers import Answer, Claim, ClaimedParameter, Smallest, read_answer
from tools.benchmarks.discovery.asking import Answered, Asking
from tools.benchmarks.discovery.real_line import result as summary
from tools.benchmarks.discovery.real_line.cases import Kind, Numbers, RealPlan, Rig, make_case
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.discovery.real_line.fitting import record_only
from tools.benchmarks.discovery.real_line.result import RealGap, RealResult
from tools.benchmarks.discovery.real_line.tables import json_document, misses
from tools.benchmarks.discovery.result import Grade, Interval
from tools.benchmarks.discovery.run import real_shown, run_real_lines
from tools.benchmarks.discovery.scoring import score_real
from tools.benchmarks.wave_recordings import maker_file

SINGLE = RealResult(
    label="0",
    kind=Kind.SINGLE,
    discrepancy="taper",
    with_rate=False,
    parts=(("seat_area", (0.1,)),),
    verdict="named",
    claims=(("seat_area", 0.95),),
    listed=("seat_area",),
    smallest=(("seat_area", 0.02), ("guide_leakage", 1e-15)),
    intervals=(Interval("v_S", 0.05, 0.15, 0.1),),
    line_pressure=RealGap(1.0, 0.2, 0.1),
    injected_mass=RealGap(2.0, 0.1, 0.1),
    seconds=3.0,
    core_seconds=2.0,
)
NOTHING = replace(
    SINGLE, verdict="none", claims=(), listed=(), intervals=(), line_pressure=None, injected_mass=None
)
WRONG = replace(SINGLE, claims=(("line_friction", 0.95),), listed=("line_friction",), intervals=())
LEFT_OPEN = replace(NOTHING, verdict="ambiguous", listed=("seat_area", "lift_gain"))
HEALTHY = replace(NOTHING, kind=Kind.HEALTHY, parts=())
PAIR = replace(
    SINGLE,
    kind=Kind.PAIR,
    parts=(("bulk_modulus", (0.05,)), ("guide_leakage", (2e-14,))),
    claims=(("line_volume", 0.9), ("guide_leakage", 0.9)),
    listed=("line_volume", "guide_leakage"),
)
OUTSIDE = replace(NOTHING, kind=Kind.OUTSIDE, parts=(("lift_leakage", (1e-13,)),), verdict="unknown")


@pytest.mark.parametrize(
    ("result", "grade"),
    [
        (SINGLE, Grade.RIGHT),
        (WRONG, Grade.WRONG),
        (NOTHING, Grade.WRONG),
        (replace(SINGLE, claims=(*SINGLE.claims, ("line_friction", 0.5))), Grade.WRONG),
        (LEFT_OPEN, Grade.AMBIGUOUS),
        (replace(LEFT_OPEN, listed=("seat_area", "line_friction")), Grade.WRONG),
        (replace(LEFT_OPEN, listed=("lift_gain", "lift_offset")), Grade.WRONG),
        (replace(SINGLE, parts=(("seat_area", (0.059,)),)), Grade.NOT_LOOKED_FOR),
        (HEALTHY, Grade.RIGHT),
        (replace(HEALTHY, verdict="ambiguous", listed=("seat_area",)), Grade.WRONG),
        (PAIR, Grade.RIGHT),
        (replace(PAIR, claims=PAIR.claims[1:]), Grade.WRONG),
        (replace(PAIR, claims=(("line_volume", 0.9), ("bulk_modulus", 0.9))), Grade.WRONG),
        (
            replace(PAIR, verdict="ambiguous", listed=("line_volume", "seat_area", "guide_leakage")),
            Grade.AMBIGUOUS,
        ),
        (replace(PAIR, verdict="ambiguous", listed=("line_volume", "seat_area")), Grade.WRONG),
        (OUTSIDE, Grade.RIGHT),
        (replace(OUTSIDE, verdict="ambiguous", listed=("seat_area",)), Grade.WRONG),
        (replace(OUTSIDE, verdict="none"), Grade.WRONG),
        (replace(OUTSIDE, verdict="named", claims=(("guide_leakage", 0.5),)), Grade.WRONG),
    ],
)
def test_answers_are_graded(result: RealResult, grade: Grade) -> None:
    assert result.grade is grade


def test_three_times_the_smallest_visible_must_be_named() -> None:
    assert SINGLE.counted
    assert SINGLE.times_smallest("seat_area") == pytest.approx(5.0)
    assert not replace(SINGLE, parts=(("seat_area", (-0.059,)),)).counted
    assert replace(SINGLE, parts=(("seat_area", (-0.061,)),)).counted
    assert replace(SINGLE, parts=(("lift_gain", (1e-6,)),)).counted  # nothing stated
    assert PAIR.counted
    assert not replace(PAIR, smallest=(("guide_leakage", 1e-14),)).counted
    assert HEALTHY.counted
    assert OUTSIDE.counted


def test_a_wrong_name_is_an_error_when_it_is_sure() -> None:
    unsure = replace(WRONG, claims=(("line_friction", 0.89),))
    assert [r.wrong_and_sure for r in (SINGLE, WRONG, unsure, LEFT_OPEN)] == [False, True, False, False]
    assert unsure.named_unsure
    accused = replace(HEALTHY, verdict="named", claims=(("seat_area", 0.9),))
    assert summary.accused([HEALTHY, accused]) == [accused]


def test_a_gap_may_grow_within_tolerances() -> None:
    assert not RealGap(0.1, 0.1029, 0.0).larger(0.003)
    assert RealGap(0.1, 0.1031, 0.0).larger(0.003)
    assert not RealGap(1.0, 1.019, 0.0).larger(0.003)
    assert RealGap(1.0, 1.021, 0.0).larger(0.003)
    assert not RealGap(0.03, 0.06, 0.06).larger(0.003)  # no better could be done
    assert not SINGLE.gap_larger
    assert replace(SINGLE, injected_mass=RealGap(1.0, 1.1, 0.9)).gap_larger
    assert not NOTHING.gap_larger


def test_missed_bars_are_said() -> None:
    good = [SINGLE] * 30 + [PAIR] * 10 + [HEALTHY] * 50 + [OUTSIDE] * 10
    late = replace(SINGLE, intervals=(Interval("v_S", 0.2, 0.3, 0.1),))
    assert list(summary.violations([*good, late], 0)) == []
    accused = replace(HEALTHY, verdict="named", claims=(("seat_area", 0.95),))
    bad = [NOTHING] * 4 + [replace(PAIR, verdict="none")] * 4 + [accused] * 2
    bad += [
        replace(OUTSIDE, verdict="none"),
        replace(SINGLE, seconds=30.1, line_pressure=RealGap(0.1, 0.2, 0.1)),
    ]
    bad += [late] * 10
    said = summary.violations(good + bad, 1)
    assert [line.split(":")[0] for line in said] == [
        "healthy, answered none",
        "singles, right or ambiguous",
        "pairs, right or ambiguous",
        "outside the vocabulary, answered unknown",
        "healthy, something named with confidence 0.9",
        "gap larger after than before",
        "coverage of the 95 % intervals",
        "exceptions",
        "seconds of a case",
    ]


def test_json_has_the_agreed_figures_and_tells_what_was_missed() -> None:
    results = [SINGLE, replace(WRONG, label="bad"), PAIR, HEALTHY, OUTSIDE]
    document = json.loads(json.dumps(json_document(results, {"taper": True}, ["case 1: failed"])))
    figures = document["figures"]
    assert {
        "cases", "named_right_share", "false_alarm_share", "pairs_right_share", "unknown_right_share", "gap_larger",
        "coverage_share", "exceptions", "seconds_max", "smallest_visible",
    } <= set(figures)  # fmt: skip
    assert figures["named_right_share"] == pytest.approx(0.5)
    assert (figures["false_alarm_share"], figures["exceptions"], figures["wrong_and_sure"]) == (0.0, 1, 1)
    assert document["details"]["grades"] == {"right": 2, "ambiguous": 0, "wrong": 1, "not looked for": 0}
    assert figures["smallest_visible"]["guide_leakage"] == "1e-15 m3/(s Pa)"
    (miss,) = misses(results)
    assert miss.startswith(
        "bad taper: seat_area 0.1 (5.0 times the smallest visible): named line_friction (0.95)"
    )
    assert "gap 1.000 to 0.200 MPa (with the true sizes 0.100)" in miss
    assert miss.endswith("SURE")


def test_smallest_visible_sizes_are_read_where_they_are_stated() -> None:
    findings = {"verdict": "none", "effects": []}
    assert read_answer("0", findings, "", 1.0, 1.0).smallest == ()
    stated = {"id": "lift_offset", "parameter": "x_0", "value": 1.5, "unit": "um"}
    answer = read_answer("0", findings | {"smallest_visible": [stated]}, "", 1.0, 1.0)
    assert answer.smallest == (Smallest("lift_offset", "x_0", 1.5, "um"),)
    result = score_real(Answered(make_case((), Rig(0, False, 1), 0), answer, NOMINAL_INJECTOR))
    assert dict(result.smallest) == pytest.approx({"lift_offset": 1.5e-6})
    assert result.right


@pytest.mark.slow
def test_the_true_effect_closes_the_gap_of_a_travelling_line(tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    lines = maker_file().replace("[line]\n", '[line]\nmodel = "wave"\n')
    model.write_text(lines)
    case = make_case(("guide_leakage",), Rig(Discrepancy.PLAIN.number, False, 1), 0)
    ((_, (size,)),) = case.parts
    value = f'c = {{ value = {size!r}, ci95 = [{size * 0.9!r}, {size * 1.1!r}], unit = "m3/(s Pa)" }}'
    amended = f'{lines}\n[[effects]]\nid = "guide_leakage"\nparameters = {{ {value} }}\n'
    amended += 'origin = "test"\nevidence = "none"\ndate = "2026-01-01"\n'
    parameters = (ClaimedParameter("c", size, 0.9 * size, 1.1 * size, "m3/(s Pa)"),)
    claims = (Claim("guide_leakage", 0.95, parameters),)
    answer = Answer("0", "named", claims, ("guide_leakage",), amended, 1.0, 1.0)
    result = score_real(Answered(case, answer, model))
    assert result.named_right
    assert [interval.holds for interval in result.intervals] == [True]
    assert result.line_pressure is not None
    assert result.line_pressure.after < result.line_pressure.before


@pytest.mark.slow
def test_a_run_fits_first_asks_with_the_fitted_model_and_goes_on_where_it_stopped(tmp_path: Path) -> None:
    stub, out = Stub(tmp_path), tmp_path / "out"
    plan = RealPlan(Numbers(1, 0, 0, 0), (True,), (Discrepancy.STEP,), 1)
    asking = Asking(plan, 1, out, stub.program)
    found = run_real_lines(asking)
    assert found.crashes == ()
    assert [(r.kind, r.right, r.discrepancy) for r in found.results] == [(Kind.HEALTHY, True, "step")]
    calls = stub.calls()
    assert [call[0] for call in calls] == ["fit", "discover", "discover"]  # one to compile
    fit, _, asked = (call[1] for call in calls)
    fitted = Path(fit[fit.index("--output") + 1])
    assert asked[asked.index("--model") + 1] == str(fitted)
    assert fitted.exists()
    assert sum(a.endswith(".csv") for a in asked) == 6
    assert not any("step" in a or "healthy" in a for a in asked)
    assert not any(Path(a).exists() for a in asked if a.endswith(".csv"))

    again = run_real_lines(asking)
    assert again.results == found.results
    assert len(stub.calls()) == len(calls)
    assert "step" in printed(real_shown(again))


@pytest.mark.slow
def test_recordings_for_trials_stay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stub, out = Stub(tmp_path), tmp_path / "out"
    plan = RealPlan(Numbers(0, 1, 0, 0), (False,), (Discrepancy.MOUNTING,), 1)
    record_only(plan, out, stub.program)
    assert len(list((out / "mounting" / "healthy").glob("*.csv"))) == 6
    assert (out / "mounting" / "fitted.toml").exists()
    ((label, hidden),) = [
        (e["label"], e["parts"][0][0]) for e in json.loads((out / "sealed.json").read_text())
    ]
    assert len(list((out / "cases" / label).glob("*.csv"))) == 6
    assert f"{label} mounting: {hidden}" in capsys.readouterr().err
