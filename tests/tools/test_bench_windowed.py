"""A windowed source: what is not recorded is not known, what is recorded is estimated as ever."""

from dataclasses import replace

import numpy as np
import pytest

from tests.observed_plants import bench_at, recording_of
from tests.plants.parameters import Faults
from tests.plants.plant import record
from tools.benchmarks.cases import Case, make_case
from tools.benchmarks.scoring import NOMINAL, Score, bench_for_case, score_outcome
from tools.benchmarks.windowed import evaluate_windowed

EVENTS = 6


def worn(class_name: str) -> Case:
    case = make_case("windowed", 1, 0)
    events = tuple(replace(e, faults=Faults(orifice_area=0.3)) for e in case.bench.events[:EVENTS])
    return replace(case, class_name=class_name, bench=replace(case.bench, events=events))


@pytest.fixture(scope="module")
def score() -> Score:
    case = worn("windowed")
    return score_outcome(case, record(case.bench), bench_for_case(case))


def test_wear_is_learned_from_windows(score: Score) -> None:
    assert abs(score.event_errors_pct(NOMINAL)[1:]).min() > 10.0
    assert abs(score.event_errors_pct()[2:]).max() < 2.0
    assert score.valid[:2] == (False, False)
    assert score.valid[-1]
    assert set(score.reasons) == {
        "",
        "TOO_FEW_EVENTS",
        "OUTSIDE_LEARNED_RANGE",
    }  # each is at a rail pressure of its own


def test_samples_and_reports_are_those_of_the_whole_recording() -> None:
    case = worn("windowed")
    outcome = record(case.bench)
    recording = recording_of(outcome)
    evaluation = evaluate_windowed(bench_at(100e3), recording)
    known = ~np.isnan(evaluation.trace.injection_rate)
    shut = np.ones(recording.samples, np.bool_)
    for opening, closing in outcome.openings:
        assert known[opening - 99 : closing + 300].all()
        shut[opening - 250 : closing + 450] = False
    assert not known[shut].any()
    starts = [r.start_index for r in evaluation.reports]
    lead = 15
    np.testing.assert_allclose(np.array(starts) + lead, outcome.openings[:, 0], atol=4)
