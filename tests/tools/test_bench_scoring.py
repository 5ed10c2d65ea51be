"""The definitions of the accuracy figures, on recordings made by hand."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tools.benchmarks.bars import recovered, sustained_excess_pct, useful_at_third, violations, x3_ratios
from tools.benchmarks.plant import Measured, Outcome, Truth
from tools.benchmarks.proportions import clopper_pearson
from tools.benchmarks.score import NOMINAL, OBSERVER, UKF, CaseScore, EstimatorScore
from tools.benchmarks.store import Store
from tools.benchmarks.tables import class_table, following_table, json_document, peer_tables
from tools.benchmarks.windows import Windows, windows_of

RATE = 100e3
DENSITY = 830.0


def outcome_of(openings: list[tuple[int, int]], event_of: list[int], samples: int = 2000) -> Outcome:
    """A recording with the needle open over ranges of samples, the injection rate 40 mm3/ms there."""
    lift, time = np.zeros(samples), np.arange(samples) / RATE
    for first, last in openings:
        lift[first : last + 1] = 2e-4
    flat = np.zeros(samples)
    return Outcome(
        Measured(time, flat, lift, flat),
        Truth(np.where(lift > 0.0, 40e-6, 0.0), flat, lift, flat, flat),
        np.array(openings),
        np.array(event_of),
    )


def test_window_is_lead_opening_and_tail() -> None:
    windows = windows_of(outcome_of([(500, 599)], [0]), RATE)
    assert windows.ranges == (slice(485, 651),)


def test_window_ends_where_the_next_opening_begins() -> None:
    windows = windows_of(outcome_of([(500, 549), (580, 699)], [0, 0]), RATE)
    assert windows.ranges == (slice(485, 581), slice(565, 751))
    assert windows.union(0).tolist() == list(range(485, 751))


@pytest.fixture
def two_events() -> tuple[Outcome, Windows]:
    outcome = outcome_of([(500, 549), (600, 699), (1500, 1599)], [0, 0, 1])
    return outcome, windows_of(outcome, RATE)


def test_masses_are_trapezoids_over_windows(two_events: tuple[Outcome, Windows]) -> None:
    outcome, windows = two_events
    masses = windows.event_masses_mg(outcome.truth.injection_rate, DENSITY)
    # 50 samples at 40 mm3/ms, 100 more and the one half under which the first window ends; then 100
    first_window_end = 0.5
    assert masses[0] == pytest.approx((150 + first_window_end) * 1e-5 * 40e-6 * DENSITY * 1e6)
    assert masses[1] == pytest.approx(100 * 1e-5 * 40e-6 * DENSITY * 1e6)


def test_rate_errors_count_every_sample_of_the_union_once(two_events: tuple[Outcome, Windows]) -> None:
    outcome, windows = two_events
    error = np.zeros(outcome.truth.injection_rate.size)
    error[590:600] = 2.0  # in both windows of the first event
    squares = windows.mean_squares(error)
    assert squares[0] == pytest.approx(10 * 4.0 / windows.union(0).size)
    assert squares[1] == 0.0


def score(mass_factor: NDArray[np.float64] | float = 1.0, **changes: object) -> CaseScore:
    """20 events of 50 mg, scored right unless told otherwise."""
    true = np.full(20, 50.0)
    made = CaseScore(
        class_name="orifice_area",
        master_seed=1,
        number=0,
        change_event=None,
        nozzle_wear=0.3,
        varying=False,
        true_mass_mg=tuple(true),
        window_samples=(200,) * 20,
        estimators=(
            EstimatorScore(OBSERVER, tuple(true * mass_factor), (0.01,) * 20, (1e-6,) * 20),
            EstimatorScore(NOMINAL, tuple(true * 0.8), (100.0,) * 20, (1e-4,) * 20),
        ),
        valid=(False, False, *(True,) * 18),
        reasons=("",) * 20,
        mass_ci95_mg=((49.0, 51.0),) * 20,
        opening_errors_pct=((0.0,),) * 20,
        training_ms=(5.0,) * 20,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


UKF_SCORE = EstimatorScore(UKF, (50.05,) * 20, (0.01,) * 20)


def factors(**at: float) -> NDArray[np.float64]:
    """1 for every event but those named event_N (from 1)."""
    result = np.ones(20)
    for name, value in at.items():
        result[int(name.removeprefix("event_")) - 1] = value
    return result


def test_mass_error_is_that_of_events_11_to_20_together() -> None:
    assert score(factors(event_10=2.0)).mass_error_pct() == pytest.approx(0.0)
    assert score(factors(event_11=1.1)).mass_error_pct() == pytest.approx(1.0)
    assert score(factors(event_11=1.1, event_20=0.9)).mass_error_pct() == pytest.approx(0.0)
    assert score().mass_error_pct(NOMINAL) == pytest.approx(-20.0)


def test_rate_rmse_and_x3_ratio() -> None:
    assert score().rate_rmse() == pytest.approx(0.1)
    assert score().x3_ratio == pytest.approx(100.0)
    assert x3_ratios([score(nozzle_wear=0.05), score(class_name="healthy")]) == []


def test_only_valid_events_can_be_wrong_while_valid() -> None:
    assert score(factors(event_1=1.5, event_2=1.5)).wrong_valid == 0
    assert score(factors(event_3=1.031)).wrong_valid == 1
    assert score(factors(event_3=1.029)).wrong_valid == 0
    rough = EstimatorScore(OBSERVER, (50.0,) * 20, (9.1,) * 20, (1e-6,) * 20)
    assert score(estimators=(rough, score().estimator(NOMINAL))).wrong_valid == 18


def test_mass_of_valid_events_leaves_the_others_out() -> None:
    valid = (False, False, *(True,) * 17, False)
    assert score(factors(event_20=2.0), valid=valid).valid_mass_error_pct() == pytest.approx(0.0)
    assert score(valid=(False,) * 20).valid_mass_error_pct() is None


def test_coverage_and_half_width() -> None:
    covered = score(limits_mg=(0.25,) * 20)
    assert covered.covered(14) is True
    assert covered.halfwidth_vs_limit(14) == pytest.approx(1.0 / (1.96 * 0.25))
    assert score(mass_ci95_mg=((50.1, 51.0),) * 20).covered(14) is False
    assert score(mass_ci95_mg=(None,) * 20).covered(14) is None


def test_third_event_and_recovery() -> None:
    assert useful_at_third(score(factors(event_2=2.0)))
    assert not useful_at_third(score(factors(event_3=1.011)))
    jumped = score(factors(event_8=1.5, event_9=1.5, event_10=1.5), change_event=7)
    assert recovered(jumped)
    assert not recovered(score(factors(event_11=1.5), change_event=7))


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
    assert json_document(some(2), [])["figures"]["first_useful_phi_share"] == pytest.approx(0.95)


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
    figures = json_document([jumped, score(factors(event_11=1.5), change_event=7)], [])["figures"]
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


def test_coverage_is_shown_with_its_interval() -> None:
    missed, held = ((50.1, 51.0),) * 20, ((49.0, 51.0),) * 20
    table = class_table([score(mass_ci95_mg=missed if n < 3 else held) for n in range(60)])
    cells = {str(column.header).split("\n")[0]: next(iter(column.cells)) for column in table.columns}
    assert cells["coverage %"] == "95 (83-99)"


def test_bars() -> None:
    assert violations([score()]) == []
    assert len(violations([score(1.0045)])) == 1  # the class's 95th percentile
    bad = violations([score(1.006)])
    assert any("orifice_area 0: mass error" in line for line in bad)
    # little information excuses a case, not its class
    little_known = score(1.006, limits_mg=(0.1,) * 20)
    excused = violations([replace(little_known, estimators=(*little_known.estimators, UKF_SCORE))])
    assert not any("orifice_area 0: mass error" in line for line in excused)
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
    wide = violations(
        [score(mass_ci95_mg=held, limits_mg=(0.3,) * 20, estimators=(*score().estimators, UKF_SCORE))]
    )
    assert len(wide) == 1
    assert "half-width" in wide[0]


def test_slow_training_and_a_better_peer_are_named() -> None:
    slow = violations([score(training_ms=(5.0,) * 19 + (30.0,))])
    assert len(slow) == 1
    assert "p99" in slow[0]
    behind = score(1.002, limits_mg=(0.5,) * 20, estimators=(*score(1.002).estimators, UKF_SCORE))
    assert sum("joint UKF" in line for line in violations([behind])) == 2


def test_interval_of_a_share() -> None:
    assert clopper_pearson(0, 10) == pytest.approx((0.0, 1.0 - 0.005**0.1))
    assert clopper_pearson(10, 10) == pytest.approx((0.005**0.1, 1.0))
    low, high = clopper_pearson(57, 60)
    assert low < 0.95 < high


def test_a_peer_counts_where_it_ran() -> None:
    alone = score(class_name="healthy", limits_mg=(0.1,) * 20)
    joined = score(estimators=(*alone.estimators, UKF_SCORE), limits_mg=(0.1,) * 20)
    mass, _ = peer_tables([alone, joined])
    cells = {column.header: list(column.cells) for column in mass.columns}
    assert cells[UKF] == ["-", "0.10 / 0.10"]
    assert cells[NOMINAL] == ["20.00 / 20.00"] * 2
    classes = json_document([alone, joined], [])["details"]["classes"]
    assert UKF in classes["orifice_area"]["peers"]
    assert UKF not in classes["healthy"]["peers"]


def test_json_document_has_the_figures_asked_for() -> None:
    document = json.loads(json.dumps(json_document([score(1.002), score(0.997)], ["crash"])))
    figures = document["figures"]
    assert figures["mass_error_max_pct"] == pytest.approx(0.3)
    assert figures["rate_rmse_max_mm3_per_ms"] == pytest.approx(0.1)
    assert figures["x3_mse_ratio_min"] == pytest.approx(100.0)
    assert figures["coverage_95_share"] == 1.0
    assert figures["valid_share_min"] == 1.0
    assert figures["wrong_valid"] == 0
    assert set(figures) >= {"interval_halfwidth_vs_limit_median"}
    assert document["details"]["crashes"] == ["crash"]


def test_interrupted_runs_go_on(tmp_path: Path) -> None:
    path = tmp_path / "results" / "observer.jsonl"
    store = Store(path, CaseScore, "now")
    first, second = score(), score(number=1, mass_ci95_mg=(None,) * 20, change_event=3)
    store.add(first)
    store.add(second)
    assert store.load() == [first, second]
    path.write_text(path.read_text()[:-40])  # killed while writing
    assert store.load() == [first]
    store.add(second)
    assert store.load() == [first, second]
    assert Store(path, CaseScore, "changed").load() == []


def test_numbers_that_are_none_survive_the_store(tmp_path: Path) -> None:
    diverged = score(math.nan)
    store = Store(tmp_path / "scores", CaseScore, "now")
    store.add(diverged)
    assert math.isnan(store.load()[0].mass_error_pct())
