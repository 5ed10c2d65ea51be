"""The optional input `measured_mass`: which injection a value belongs to, and where its comparison is shown."""

import io
import time
from collections.abc import Iterable
from pathlib import Path

import pytest
from rich.console import Console

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.check.checkup import Level, checkup
from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.evaluation.results import print_evaluation
from observer_rt.foundation.errors import UserError
from observer_rt.model.effects import effective_model
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.news import MeasuredMass, Notes
from observer_rt.service.screen.view import View
from tests.device import Result, damaged, hand, inserted, run
from tests.evaluation.documents import recording_json
from tests.recording.canlog.log_cases import sent_log, write_log
from tests.service.participants import ScriptedLink, assert_warm_up_takes_all
from tests.service.slow_frames import bed, safe_bed, slow_bench

MASS = {"measured_mass": ("Bed", "Mass")}
SAFE_MASS = {"measured_mass": ("SafeBed", "MassSafe")}
BLOCK = 9  # samples in a frame
SOON, LATE = 20, 250  # frames after an injection's end: before, and after, it is reported


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory, frames: list[TimedFrame]) -> Result:
    """With the role in the bench file, but no frame of it."""
    return run(slow_bench(tmp_path_factory.mktemp("usual"), MASS), frames)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return slow_bench(tmp_path, MASS)


def after(result: Result, injection: int, frames: int) -> int:
    """Number of a frame so many after the end of an injection (1, 2, 3)."""
    return result.reports[injection - 1].end_index // BLOCK + frames


def measured(bench: Path, frames: Iterable[TimedFrame]) -> list[MeasuredMass]:
    return run(bench, frames).notes.measured


def masses(found: Iterable[MeasuredMass]) -> list[tuple[int, float]]:
    """Injection and mass [mg]."""
    return [(one.report.number, round(one.mass * 1e6, 6)) for one in found]


@pytest.mark.parametrize("delay", [SOON, LATE])
def test_a_value_belongs_to_the_injection_before_it(
    path: Path, frames: list[TimedFrame], usual: Result, delay: int
) -> None:
    sent = [
        (after(usual, 1, delay), bed("Mass", 10.0)),
        (after(usual, 2, delay), bed("Mass", 8.0)),
        (after(usual, 3, delay), bed("Mass", 9.0)),
    ]
    found = measured(path, inserted(frames, sent))
    assert masses(found) == [(1, 10.0), (2, 8.0), (3, 9.0)]
    for one, report in zip(found, usual.reports, strict=True):
        assert one.error == pytest.approx((report.mass - one.mass) / one.mass)
        assert f"injection {report.number}: measured {one.mass * 1e6:.2f} mg" in one.as_text()


def test_it_changes_no_result(path: Path, frames: list[TimedFrame], usual: Result) -> None:
    sent = [(after(usual, number, SOON), bed("Mass", 100.0 * number)) for number in (1, 2, 3)]
    assert run(path, inserted(frames, sent)).frames == usual.frames


def test_what_a_cyclic_message_repeats_is_not_new(
    path: Path, frames: list[TimedFrame], usual: Result
) -> None:
    """The value of an injection changes soon after it and is sent until the next one's."""
    changes = [(0, 5.0), (after(usual, 1, SOON), 10.0), (after(usual, 2, SOON), 8.0)]
    sent = []
    for number in range(0, len(frames), 10):
        sent.append((number, bed("Mass", [value for since, value in changes if since <= number][-1])))
    assert masses(measured(path, inserted(frames, sent))) == [(1, 10.0), (2, 8.0)]


@pytest.mark.parametrize("nothing", [0.0, None])
def test_nothing_in_between_makes_an_equal_value_new(
    path: Path, frames: list[TimedFrame], usual: Result, nothing: float | None
) -> None:
    sent = [
        (after(usual, 1, SOON), bed("Mass", 10.0)),
        (after(usual, 2, 0) - 20, bed("Mass", nothing)),
        (after(usual, 2, SOON), bed("Mass", 10.0)),
    ]
    assert masses(measured(path, inserted(frames, sent))) == [(1, 10.0), (2, 10.0)]


def test_of_several_for_one_injection_the_first_counts(
    path: Path, frames: list[TimedFrame], usual: Result
) -> None:
    sent = [(after(usual, 1, SOON + k), bed("Mass", 10.0 + k)) for k in range(3)]
    assert masses(measured(path, inserted(frames, sent))) == [(1, 10.0)]


def test_a_value_before_any_injection_belongs_to_none(path: Path, frames: list[TimedFrame]) -> None:
    assert not measured(path, inserted(frames, [(0, bed("Mass", 10.0))]))


def test_protected_message_in_kilograms(tmp_path: Path, frames: list[TimedFrame], usual: Result) -> None:
    """A damaged frame and a repeated one count for nothing."""
    first, second = after(usual, 1, SOON), after(usual, 2, SOON)
    good = safe_bed(1, mass=12e-6)
    sent = [
        (first, damaged(safe_bed(0, mass=11e-6), 40)),
        (first + 1, good),
        (second, safe_bed(1, mass=13e-6)),
        (second + 1, safe_bed(2, mass=14e-6)),
    ]
    bench = slow_bench(tmp_path, SAFE_MASS)
    assert masses(measured(bench, inserted(frames, sent))) == [(1, 12.0), (2, 14.0)]


def test_unit_of_the_bench_file_goes_before_the_databases(
    tmp_path: Path, frames: list[TimedFrame], usual: Result
) -> None:
    bench = slow_bench(tmp_path, MASS)
    bench.write_text(bench.read_text() + 'unit = "g"\n')
    sent = [(after(usual, 1, SOON), bed("Mass", 0.5))]
    assert masses(measured(bench, inserted(frames, sent))) == [(1, 500.0)]


def test_unknown_unit(path: Path) -> None:
    path.write_text(path.read_text() + 'unit = "mm"\n')
    with pytest.raises(UserError) as caught:
        map_bus(load_bench(path))
    assert "signals.measured_mass" in caught.value.place
    assert "mg" in caught.value.remedy


def test_check_lists_it(path: Path) -> None:
    listed = [one for one in checkup(load_bench(path)) if one.text.startswith("measured_mass")]
    assert [finding.level for finding in listed] == [Level.OK]
    assert "Bed 0x321, Mass, 0 to 655 mg" in listed[0].text


def test_warm_up_takes_a_bench_with_optional_inputs(tmp_path: Path) -> None:
    assert_warm_up_takes_all(load_bench(slow_bench(tmp_path, SAFE_MASS)))


def test_evaluating_a_log_compares_it(
    path: Path, frames: list[TimedFrame], usual: Result, tmp_path: Path
) -> None:
    """In the document and in the table."""
    bench = load_bench(path)
    sent = inserted(frames, [(after(usual, 2, SOON), bed("Mass", 8.0))])
    log = tmp_path / "bus.log"
    write_log(log, sent_log(sent))
    evaluation = evaluate(bench, [LoggedSignals(bench, log)]).evaluations[0]
    c = effective_model(bench.injector.parameters).coefficients
    injections = recording_json(evaluation, c)["injections"]
    assert [one["measured_mass_mg"] for one in injections] == [None, pytest.approx(8.0), None]
    screen = io.StringIO()
    print_evaluation(evaluation, c, Console(file=screen, width=80, color_system=None))
    error = 100 * (injections[1]["mass_mg"] / 8.0 - 1)
    row = next(line for line in screen.getvalue().splitlines() if line.startswith(" 2 "))
    assert {"8.00", f"{error:.2f}"} <= set(row.split())


def test_view_shows_it_beside_the_estimate(tmp_path: Path, frames: list[TimedFrame], usual: Result) -> None:
    bench = load_bench(slow_bench(tmp_path, MASS, "[learning]\nlockstep = true"))
    view, notes = View("title", bench.injector), Notes()
    daemon = Daemon(bench, map_bus(bench), [ScriptedLink()], listeners=[view.hear, notes])
    view.watch(daemon)

    def drawn() -> str:
        screen = io.StringIO()
        Console(file=screen, width=80, color_system=None).print(view.render(time.monotonic_ns(), 80, 40))
        return screen.getvalue()

    sent = inserted(frames, [(after(usual, 2, LATE), bed("Mass", 7.77))])
    hand(daemon.core, sent[: after(usual, 2, LATE)])
    assert " measured " not in drawn()
    hand(daemon.core, sent[after(usual, 2, LATE) :])
    daemon.core.finish()
    assert " measured " in drawn()
    assert drawn().count("7.77") == 1
    assert all(f" {report.mass * 1e6:.2f} " in drawn() for report in notes.injections)
