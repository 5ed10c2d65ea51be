"""An injector as it is seen on the bus: the injections its observer reported, with the samples they were made of."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_bench
from observer_rt.desk.live_page.injector import Seen, WatchedInjector
from observer_rt.desk.live_page.samples import SampleCurves, SeenInjection
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLIMETRE
from tests.benches import SAMPLE_RATE
from tests.daemon.participants import bench_file
from tests.desk.live_page.traffic import BEGIN, Observed, traffic
from tests.device import frames_of, worn_recording

WEAR = 0.2


class Watched:
    """A recording, its observer's reports, and what was seen of them on the bus."""

    def __init__(self, bench: Bench, recording: Recording) -> None:
        self.recording = recording
        observer = Observed(bench)
        frames = frames_of(bench, recording)
        self.came: Sequence[BusFrame] = list(traffic(frames, [observer]))
        self.reports = observer.reports
        self.seen = seen_after(bench, self.came)


def seen_after(bench: Bench, came: Sequence[BusFrame]) -> Seen:
    injector = WatchedInjector(bench)
    injector.begin(BEGIN)
    for each in came:
        injector.take(each, each.frame.stamp_ns)
    return injector.seen(came[-1].frame.stamp_ns)


def valid(seen: Seen) -> list[SeenInjection]:
    found = [each for each in seen.injections if each.summary.valid]
    assert found
    return found


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return load_bench(bench_file(tmp_path_factory.mktemp("watched"), "watched"))


@pytest.fixture(scope="module")
def watched(bench: Bench) -> Watched:
    return Watched(bench, worn_recording(6, WEAR))


def curves_of(seen: SeenInjection) -> SampleCurves:
    assert seen.curves is not None
    return seen.curves


def assert_recorded(seen: SeenInjection, recording: Recording, report: InjectionReport) -> None:
    """Its samples are those of the recording."""
    window, curves = slice(report.start_index, report.end_index + 1), curves_of(seen)
    assert curves.rail_pressure == pytest.approx(recording.rail_pressure[window] / MEGAPASCAL, abs=0.004)
    assert curves.line_pressure == pytest.approx(recording.line_pressure[window] / MEGAPASCAL, abs=0.004)
    assert curves.needle_lift * 1e-3 == pytest.approx(recording.needle_lift[window] / MILLIMETRE, abs=1e-5)
    assert curves.time[-1] == pytest.approx(1e3 * (curves.time.size - 1) / SAMPLE_RATE, rel=1e-6)


def test_every_reported_injection_is_seen(watched: Watched) -> None:
    assert len(watched.reports) >= 5
    assert [each.summary.injection_number for each in watched.seen.injections] == [
        each.number for each in watched.reports
    ]
    for seen, report in zip(watched.seen.injections, watched.reports, strict=True):
        assert seen.summary.mass == pytest.approx(report.mass / MILLIGRAM, abs=0.01)
        assert (seen.summary.valid == 1.0) == report.valid


def test_its_samples_are_those_of_the_recording(watched: Watched) -> None:
    for seen, report in zip(watched.seen.injections, watched.reports, strict=True):
        assert_recorded(seen, watched.recording, report)


def test_its_rate_is_the_published_one_and_has_its_mass(watched: Watched) -> None:
    for seen, report in zip(watched.seen.injections[1:], watched.reports[1:], strict=True):
        volume = float(np.trapezoid(curves_of(seen).rate, curves_of(seen).time))  # mm3
        assert 1e-3 * volume * report.density == pytest.approx(seen.summary.mass, rel=0.01)


def test_the_nominal_model_is_right_for_a_healthy_injector_and_misses_wear(
    bench: Bench, watched: Watched
) -> None:
    for seen in valid(Watched(bench, worn_recording(6, 0.0)).seen):
        assert seen.nominal_mass == pytest.approx(seen.summary.mass, rel=0.01)
    for seen in valid(watched.seen):
        assert seen.summary.mass / seen.nominal_mass == pytest.approx(1.0 + WEAR, abs=0.05)
        assert curves_of(seen).phi_3.min() < -100.0
        assert not curves_of(seen).phi_2.any()


def test_an_injection_whose_samples_nobody_heard_has_no_curves(bench: Bench, watched: Watched) -> None:
    bus = map_bus(bench)
    inputs = {layout.frame_id for layout in bus.input_layouts}
    seen = seen_after(bench, [each for each in watched.came if each.frame.frame_id not in inputs])
    assert len(seen.injections) == len(watched.reports)
    assert all(each.curves is None and np.isnan(each.nominal_mass) for each in seen.injections)


@pytest.mark.parametrize("missed", [0, 701])
def test_samples_without_an_index_are_placed_by_the_published_rate(tmp_path: Path, missed: int) -> None:
    """Whether the page listened from the first frame on, or began later: then it counts otherwise."""
    path = bench_file(tmp_path, "counted")
    line = 'pattern = "LinePressure_{:02d}"\n'
    path.write_text(path.read_text().replace(line, f'{line}index = ""\n'))
    bench = load_bench(path)
    watched = Watched(bench, worn_recording(6, WEAR))
    seen = seen_after(bench, watched.came[missed:])
    reports = {report.number: report for report in watched.reports}
    drawn = [each for each in seen.injections if each.curves is not None]
    assert len(drawn) >= 3
    for each in drawn:
        assert_recorded(each, watched.recording, reports[int(each.summary.injection_number)])
        volume = float(np.trapezoid(curves_of(each).rate, curves_of(each).time))
        assert volume == pytest.approx(each.summary.volume, rel=0.01)
