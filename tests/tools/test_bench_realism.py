"""Right, refused, rough, wrong: by made scores; and `tools/bench realism` as its users see it."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import Evaluation
from observer_rt.engine.stream.state import Reason
from tests.plants.windows import Windows
from tests.tools.made_scores import UKF_SCORE, factors, score
from tests.tools.test_bench_accuracy import bench
from tools.benchmarks.realism.catalogue import alone
from tools.benchmarks.realism.disturbance import Reasons
from tools.benchmarks.realism.run import is_known, phantoms
from tools.benchmarks.realism.score import Results, RunScore, Verdict, missed_bars, summary
from tools.benchmarks.score import CaseScore
from tools.benchmarks.scoring import with_signals

HUM, FILTER = "hum_50_hz_line 0.2", "lift_filter 10"


def run(case: CaseScore | None = None, name: str = HUM, **changes: object) -> RunScore:
    """A recording scored right unless told otherwise."""
    nothing = ((-0.01, 0.01),) * 20
    made = RunScore(name, 1, 0, 0.25, case or score(), nothing, nothing, phantoms=0)
    return replace(made, **changes)  # type: ignore[arg-type]


def valid_from(first: int, *refused: int) -> tuple[bool, ...]:
    """Events (from 1) valid from one on but for some."""
    return tuple(n >= first and n not in refused for n in range(1, 21))


def reasons(given: str) -> tuple[str, ...]:
    return (given,) * 20


def test_right_is_valid_and_close_in_events_8_to_20() -> None:
    assert run().verdict is Verdict.RIGHT
    assert run(score(valid=valid_from(8))).verdict is Verdict.RIGHT
    assert run(score(factors(event_7=1.02))).verdict is Verdict.RIGHT
    assert run(score(valid=valid_from(8, 9, 14))).verdict is Verdict.RIGHT  # 11 of 13


def test_valid_and_beyond_one_percent_is_rough() -> None:
    assert run(score(factors(event_9=1.02, event_11=1.02))).verdict is Verdict.ROUGH
    assert run(score(1.011)).verdict is Verdict.ROUGH
    assert run(score(0.991)).verdict is Verdict.RIGHT


def test_one_valid_event_beyond_three_percent_is_wrong_wherever_it_is() -> None:
    for number in (3, 8, 20):
        made = run(score(factors(**{f"event_{number}": 0.969})))
        assert (made.verdict, made.wrong_valid) == (Verdict.WRONG, 1)
    assert run(score(factors(event_2=1.5))).wrong_valid == 0  # not valid
    assert run(phantoms=2).wrong_valid == 2
    assert run(phantoms=2).verdict is Verdict.WRONG


def test_refusals_are_true_or_not_by_what_disturbs() -> None:
    never = (False,) * 20
    assert not run(score(reasons=reasons("CONTRADICTED"), valid=never)).untrue
    untrue = run(score(reasons=reasons("MODEL_INADEQUATE"), valid=never)).untrue
    assert untrue == {"MODEL_INADEQUATE": 13}
    both = run(score(reasons=reasons("CONTRADICTED NEEDLE_STUCK"), valid=never))
    assert both.refusals == {"CONTRADICTED": 13, "NEEDLE_STUCK": 13}
    assert both.untrue == {"NEEDLE_STUCK": 13}
    pair = run(score(reasons=reasons("CONTRADICTED NEEDLE_STUCK"), valid=never), f"{HUM} + lift_zero_sine 3")
    assert not pair.untrue
    total = summary([both, pair, run()])
    assert total.true_refusals == 1
    assert total.verdicts == {"right": 1, "refused": 2, "rough": 0, "wrong": 0}


def test_wear_of_a_healthy_injector_is_false_when_it_lasts() -> None:
    seen = ((0.02, 0.04),) * 20
    assert run(wear=0.0, nozzle_ci95=seen).false_wear == pytest.approx(0.02)
    assert run(wear=0.0, seat_ci95=((-0.05, -0.03),) * 20).false_wear == pytest.approx(0.03)
    assert run(wear=0.25, nozzle_ci95=seen).false_wear == 0.0
    seldom = (*((-0.01, 0.01),) * 14, *((0.02, 0.04),) * 6)
    assert run(wear=0.0, nozzle_ci95=seldom).false_wear == 0.0
    assert run(wear=0.0, nozzle_ci95=(None,) * 20).false_wear == 0.0
    assert summary([run(wear=0.0, nozzle_ci95=seen), run(wear=0.0), run()]).falsely_worn == 1


def test_summary_counts_events_and_their_intervals() -> None:
    narrow = score(factors(event_8=1.005), mass_ci95_mg=((49.9, 50.1),) * 20)
    off = score(mass_ci95_mg=((50.1, 50.2),) * 20, valid=valid_from(8, 9, 14))
    total = summary([run(narrow), run(off)])
    assert total.events == 26
    assert total.valid_share == pytest.approx(24 / 26)
    assert total.coverage == pytest.approx(13 / 24)
    assert total.mass_max_pct == pytest.approx(0.5)
    assert total.ukf_p95_pct is None
    beside = replace(score(), estimators=(*score().estimators, UKF_SCORE))
    assert summary([run(beside)]).ukf_p95_pct == pytest.approx(0.1)


def test_bars_name_what_misses_them() -> None:
    refused = run(score(valid=(False,) * 20, reasons=reasons("MODEL_INADEQUATE")))
    lines = missed_bars(Results((refused,), (), ()))
    assert lines == [
        f"{HUM}: not right, although in the table",
        "all: 0% right < 85%",
        "all: 1 of 1 refused for what is not true",
    ]
    wrong = missed_bars(Results((run(score(1.04)), run(name="late_rail 10")), (), ()))
    assert wrong == [f"{HUM}: 18 events valid and wrong", "all: 50% right < 85%"]
    worn = run(name="late_rail 10", wear=0.0, seat_ci95=((0.02, 0.04),) * 20)
    assert missed_bars(Results((worn,), (), ())) == [
        "late_rail 10: wear 0.02 beyond its interval in 1 of 1 healthy recordings"
    ]
    assert missed_bars(Results((run(),), (), ())) == []


def test_what_needs_a_statement_may_be_refused_truly_without_it() -> None:
    named = run(score(valid=(False,) * 20, reasons=reasons("TIME_BASE")), FILTER)
    right = run(name=f"{FILTER} stated")
    assert missed_bars(Results((named, *(right,) * 9), (), ())) == []
    untrue = replace(named, case=replace(named.case, reasons=reasons("NEEDLE_STUCK")))
    assert f"{FILTER}: not right, although in the table" in missed_bars(Results((untrue, right), (), ()))


def test_valid_injections_away_from_every_opening_are_phantoms() -> None:
    def report(start: int, end: int, valid: bool = True) -> SimpleNamespace:
        return SimpleNamespace(start_index=1000 + start, end_index=1000 + end, valid=valid)

    def counted(*reports: SimpleNamespace) -> int:
        evaluation = SimpleNamespace(samples=500, first_index=1000, reports=reports)
        return phantoms(cast(Evaluation, evaluation), windows)

    windows = Windows(
        (slice(100, 151), slice(300, 401)), (slice(115, 130), slice(315, 380)), ((0,), (1,)), 1e-5
    )
    assert counted(report(90, 100), report(150, 200), report(310, 350), report(90, 420)) == 0
    assert counted(report(90, 99), report(151, 200), report(401, 499)) == 3
    assert counted(report(200, 220, valid=False)) == 0


@pytest.mark.slow
def test_command_scores_a_recording_and_goes_on(tmp_path: Path) -> None:
    arguments = ("realism", "--only", "noise 2", "--cases", "1", "--workers", "1")
    first = bench(*arguments, "--json", "--out", str(tmp_path))
    assert first.returncode == 0, first.stderr
    figures = json.loads(first.stdout)["figures"]
    assert figures["events"] == 13
    assert figures["wrong_valid"] == 0
    assert 0.0 < figures["ukf_mass_p95_pct"] < 50.0
    stored = (tmp_path / "observer.jsonl").read_text()
    again = bench(*arguments, "--out", str(tmp_path))
    assert (tmp_path / "observer.jsonl").read_text() == stored
    assert "noise 2" in again.stdout


def test_what_a_disturbance_states_goes_into_the_bench_file() -> None:
    every = [each.stated for entry in alone() for each in entry if each.is_stated]
    assert len(every) > 10
    assert all(map(is_known, every))
    assert not is_known({"rail_pressure": {"late_us": 10.0}})
    bench = load_bench()
    for stated in every:
        signals = with_signals(bench, stated).injector.config.signals
        for role, keys in stated.items():
            assert {key: getattr(getattr(signals, role), key) for key in keys} == keys


def test_every_reason_that_may_be_true_is_one_of_the_observer() -> None:
    declared = [names for names in vars(Reasons).values() if isinstance(names, frozenset)]
    assert len(declared) > 10
    assert {name for names in declared for name in names} <= set(Reason.__members__)
