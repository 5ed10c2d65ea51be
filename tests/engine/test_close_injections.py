"""Injections so close that the flow of one reaches into the next: each sample belongs to one of them."""

from itertools import pairwise

import numpy as np
import pytest

from observer_rt.desk.evaluation.evaluate import evaluate
from tests.observed_plants import bench_at, recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record
from tests.plants.windows import windows_of

SHOTS = (0.6e-3, 0.9e-3, 0.7e-3)  # s, durations
EVENTS = 7


@pytest.mark.parametrize("rail", [60e6, 140e6])
@pytest.mark.parametrize("gap", [40e-6, 90e-6, 180e-6])
def test_their_masses_sum_to_what_was_injected(gap: float, rail: float) -> None:
    starts = np.cumsum([0.0, *(duration + gap for duration in SHOTS[:-1])])
    shots = tuple(Shot(float(start), duration) for start, duration in zip(starts, SHOTS, strict=True))
    part = Injector()
    bench = Bench(part, Needle(), (Event(rail, shots, Faults()),) * EVENTS, seed=4)
    outcome = record(bench)
    evaluation = evaluate(bench_at(bench.sample_rate), [recording_of(outcome)]).evaluations[0]
    published = evaluation.trace.injection_rate
    windows, rate = windows_of(outcome, bench.sample_rate), outcome.truth.injection_rate
    masses = windows.masses(rate, part.density)
    for event, openings in enumerate(windows.of_event):
        reports = [evaluation.reports[i] for i in openings]
        for before, after in pairwise(reports):
            assert before.end_index == after.start_index  # between its ends each sample is of one
        samples = slice(reports[0].start_position, reports[-1].end_position + 1)
        complete = np.trapezoid(published[samples]) * windows.interval
        live = sum(report.live_mass / report.density for report in reports)
        assert live == pytest.approx(complete, rel=1e-12)
        assert all(report.valid for report in reports)
        injected = np.trapezoid(rate[windows.union(event)]) * windows.interval * part.density
        assert sum(report.mass for report in reports) == pytest.approx(injected, rel=5e-3 if event else 1e-2)
        for report, i in zip(reports, openings, strict=True):
            assert abs(report.mass - masses[i]) <= report.mass_bound


def test_the_nearer_they_are_the_less_is_known_of_each() -> None:
    """At 140 MPa the needle's tail lasts longer than 40 us."""
    bounds = []
    for gap in (40e-6, 300e-6):
        shots = Shot(0.0, 0.8e-3), Shot(0.8e-3 + gap, 0.8e-3)
        bench = Bench(Injector(), Needle(), (Event(140e6, shots, Faults()),) * EVENTS, seed=4)
        reports = evaluate(bench_at(bench.sample_rate), [recording_of(record(bench))]).evaluations[0].reports
        bounds.append(reports[-1].mass_bound / reports[-1].mass)
    assert bounds[0] > 2.0 * bounds[1]
