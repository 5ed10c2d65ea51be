"""Needles of benches without a lift: unlike the file's, commanded long enough, judged against what was drawn."""

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from tests.observed_plants import bench_at
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot
from tools.benchmarks.cases import make_case
from tools.benchmarks.faults.command import score_scenario
from tools.benchmarks.faults.scenario import Task
from tools.benchmarks.needles import LARGE_JITTER, SHAPES, SHORTEST, How, Kind, recorded, score_by, with_kept_needle

EVENTS = tuple(Event(pressure, (Shot(0.0, 0.3e-3),), Faults()) for pressure in (50e6, 100e6, 150e6))


@pytest.mark.parametrize("kind", Kind)
def test_a_needle_answers_as_drawn_and_the_files_as_the_file_has_it(kind: Kind) -> None:
    injector, bench = load_injector(), Bench(Injector(), Needle(), EVENTS, seed=4)
    bench_run = recorded(bench, injector.needle_law, kind)
    recording, opened = bench_run.recording, bench_run.outcome.openings[:, 0]
    assert recording.energizing is not None
    edges = recording.time[1:][np.diff(recording.energizing) != 0.0].reshape(-1, 2)
    assert np.diff(edges).min() > SHORTEST - 3.0 * LARGE_JITTER
    delays = recording.time[opened[np.r_[True, np.diff(opened) > 1000]]] - edges[:, 0]
    late = bench_run.later[0] + injector.needle_law.opening_delay
    assert delays == pytest.approx(np.full(3, late), abs=3.0 * LARGE_JITTER)
    assert (bench_run.bench.around.motion is not None) == (kind in SHAPES)
    kept = with_kept_needle(recording, injector).needle_lift > 5e-6
    first = recording.time[kept & (recording.time > edges[1, 0])][0] - edges[1, 0]
    assert first == pytest.approx(injector.needle_law.opening_delay, abs=20e-6)


def test_the_first_injection_stands_apart_and_the_kept_needle_is_worse() -> None:
    case = make_case("healthy", 1, 0)
    row = score_by(How(with_peer=True, has_lift=False), case, bench_at(case.bench.sample_rate))
    assert row["first_valid"]
    assert len(row["first_errors_pct"]) == len(row["first_opening_us"]) == len(case.bench.events[0].shots)
    assert max(row["closing_us"]) < 30.0
    assert np.median(np.abs(row["observer_errors_pct"])) < 0.5
    assert row["observer_rmse"] < 0.5 * row["kept_rmse"]


def test_a_recording_without_faults_is_right_without_a_lift() -> None:
    row = score_scenario(Task("none 0", 1, 0), has_lift=False)
    assert (row["right"], row["wrong_samples"], row["wrong_summaries"]) == (True, 0, 0)
