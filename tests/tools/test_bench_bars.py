"""Bars, tables and data of the accuracy figures, on scores made by hand."""

import math
from dataclasses import replace

import pytest

from tests.tools.made_scores import UKF_SCORE, factors, score
from tools.benchmarks.accuracy import following_table, json_document, peer_tables
from tools.benchmarks.bars import sustained_excess_pct, violations
from tools.benchmarks.score import EKF, NOMINAL, UKF, CaseScore, SampleTime

QUICK = SampleTime(open_us=2.0, closed_us=0.5)


def test_coverage_of_the_rate_is_a_classs_mean_from_the_fifth_event_on() -> None:
    narrow = score(rate_covered=(100,) * 4 + (80,) * 16)
    assert narrow.rate_coverage == pytest.approx(0.8)
    assert score(rate_judged=(0,) * 20, rate_covered=(0,) * 20).rate_coverage is None
    assert any("interval of the rate: 80.0%" in line for line in violations([narrow]))
    assert violations([narrow] + [score()] * 2) == []
    assert len(violations([score(rate_covered=(99,) * 20)])) == 1
    document = json_document([narrow, score()], [], QUICK)
    assert document["figures"]["rate_coverage_share"] == pytest.approx(0.875)


def test_the_first_useful_phi_is_asked_of_all_wear_together() -> None:
    late = factors(event_3=1.011)
    names = ("orifice_area", "growing_wear", "missing_injections", "seat_area")

    def some(missed: int) -> list[CaseScore]:
        return [
            score(late if n < missed else 1.0, class_name=names[n % 4], varying=n % 2 == 1) for n in range(40)
        ]

    assert not any("third event" in line for line in violations(some(1)))
    assert any("third event: 95.0% of 40 cases" in line for line in violations(some(2)))
    assert not any("third event" in line for line in violations([score(late, class_name="healthy")]))
    assert json_document(some(2), [], QUICK)["figures"]["first_useful_phi_share"] == pytest.approx(0.95)


def test_table_of_what_is_followed_in_time() -> None:
    early = [score(varying=True), score(factors(event_3=1.02)), score(class_name="healthy")]
    jumped = score(class_name="jump_friction", change_event=7)
    table = following_table([*early, jumped])
    rows = list(zip(*(column.cells for column in table.columns), strict=True))
    assert [row[:4] for row in rows] == [
        ("orifice_area", "third event", "2", "50.0"),
        ("jump_friction", "3 events after the change", "1", "100.0"),
        ("wear, all classes", "third event", "2", "50.0"),
    ]
    assert rows[0][5:] == ("0.0", "100.0")
    assert rows[1][5:] == ("100.0", "-")
    figures = json_document([jumped, score(factors(event_11=1.5), change_event=7)], [], QUICK)["figures"]
    assert figures["recovered_after_three_share"] == 0.5


def test_excess_over_the_nominal_model_counts_from_the_fourth_event_on() -> None:
    three = factors(event_1=1.5, event_5=1.5, event_9=1.5, event_10=1.205)
    assert sustained_excess_pct(score(three)) == pytest.approx(0.5)  # the nominal model is 20 % off
    assert not any("worse" in line for line in violations([score(three, class_name="stability")]))
    four = factors(event_1=1.5, event_5=1.5, event_9=1.5, event_10=1.25)
    bad = violations([score(four, class_name="stability", valid=(False,) * 20)])
    assert any(line.startswith("stability: over 1 % worse") and "100.00%" in line for line in bad)
    assert any(line.startswith("stability 0: more than three events 5 % worse") for line in bad)
    not_a_number = factors(event_1=1.5, event_5=1.5, event_9=1.5, event_10=math.nan)
    assert sustained_excess_pct(score(not_a_number)) > 20.0


def test_bars() -> None:
    assert violations([score()]) == []
    assert len(violations([score(1.0045)])) == 1  # the class's 95th percentile
    one_of_many = violations([score(factors(event_12=1.007))])
    assert (
        one_of_many == [line for line in one_of_many if "orifice_area 0: mass error, largest" in line] != []
    )
    assert any("wave" in line for line in violations([score(class_name="wave_healthy")]))
    assert violations([score(class_name="lift_offset")]) == []
    assert len(violations([score(factors(event_5=1.04), class_name="lift_offset")])) == 1


def test_intervals_are_judged_by_class_and_all_together() -> None:
    missed, held = ((50.1, 51.0),) * 20, ((49.0, 51.0),) * 20
    some = [score(mass_ci95_mg=missed if n < 4 else held) for n in range(10)]
    assert any("orifice_area: coverage" in line for line in violations(some))
    assert violations([score(mass_ci95_mg=missed if n < 1 else held) for n in range(20)]) == []
    many = [score(mass_ci95_mg=missed if n < 30 else held) for n in range(400)]
    assert any(line.startswith("all: coverage") for line in violations(many))


def test_slow_training_and_a_better_peer_are_named() -> None:
    slow = violations([score(training_ms=(5.0,) * 19 + (30.0,))])
    assert len(slow) == 1
    assert "p99" in slow[0]
    behind = score(1.002, estimators=(*score(1.002).estimators, UKF_SCORE))
    assert sum("joint UKF" in line for line in violations([behind])) == 2


def test_a_peer_counts_where_it_ran() -> None:
    alone = score(class_name="healthy", estimators=(*score().estimators, replace(UKF_SCORE, name=EKF)))
    joined = score(estimators=(*score().estimators, UKF_SCORE))
    mass, _ = peer_tables([alone, joined])
    cells = {column.header: list(column.cells) for column in mass.columns}
    assert cells[UKF] == ["-", "0.10 / 0.10"]
    assert cells[NOMINAL] == ["20.00 / 20.00"] * 2
    classes = json_document([alone, joined], [], QUICK)["details"]["classes"]
    assert UKF in classes["orifice_area"]["peers"]
    assert UKF not in classes["healthy"]["peers"]
