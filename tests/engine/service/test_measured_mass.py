"""The optional input `measured_mass`: which injection a value belongs to, and where its comparison is shown."""

from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.model.effects import effective_model
from tests.daemon.participants import HeardDaemon, ScriptedLink
from tests.daemon.slow_frames import bed, safe_bed, slow_bench
from tests.desk.evaluation.documents import recording_json, screen_text
from tests.device import Result, Traffic, damaged, hand, inserted, run
from tests.files.canlog.log_cases import sent_log, write_log

MASS = {"measured_mass": ("Bed", "Mass")}
SAFE_MASS = {"measured_mass": ("SafeBed", "MassSafe")}
BLOCK = 9  # samples in a frame
SOON, LATE = 20, 250  # frames after an injection's end: before, and after, it is reported


class Scale:
    def __init__(self, folder: Path, clean: Traffic) -> None:
        self.path = slow_bench(folder, MASS)
        self.frames, self.usual = clean.frames, clean.result

    def after(self, injection: int, frames: int = SOON) -> int:
        """Number of a frame so many after the end of an injection (1, 2, 3)."""
        return self.usual.reports[injection - 1].end_index // BLOCK + frames

    def tells(self, *measured_masses: tuple[int, TimedFrame]) -> Result:
        return run(self.path, inserted(self.frames, measured_masses))

    def masses(self, *measured_masses: tuple[int, TimedFrame]) -> list[tuple[int, float]]:
        result = self.tells(*measured_masses).notes.measured
        return [(one.report.number, round(one.mass * 1e6, 6)) for one in result]


@pytest.fixture
def scale(tmp_path: Path, clean: Traffic) -> Scale:
    return Scale(tmp_path, clean)


@pytest.mark.parametrize("delay", [SOON, LATE])
def test_a_value_belongs_to_the_injection_before_it(scale: Scale, delay: int) -> None:
    sent = [(scale.after(n, delay), bed("Mass", mass)) for n, mass in ((1, 10.0), (2, 8.0), (3, 9.0))]
    assert scale.masses(*sent) == [(1, 10.0), (2, 8.0), (3, 9.0)]
    for error_note, report in zip(scale.tells(*sent).notes.measured, scale.usual.reports, strict=True):
        assert error_note.error == pytest.approx((report.mass - error_note.mass) / error_note.mass)
        assert f"injection {report.number}: measured {error_note.mass * 1e6:.2f} mg" in error_note.as_text()
    scale.path = slow_bench(scale.path.parent, MASS | {"energizing": ("Bed", "LearnEnable")})  # of which none comes
    assert scale.masses(*sent) == [(1, 10.0), (2, 8.0), (3, 9.0)]


def test_it_changes_no_result(scale: Scale) -> None:
    sent = [(scale.after(number), bed("Mass", 100.0 * number)) for number in (1, 2, 3)]
    assert scale.tells(*sent).frames == scale.usual.frames


def test_what_a_cyclic_message_repeats_is_not_new(scale: Scale) -> None:
    """The value of an injection changes soon after it and is sent until the next one's."""
    changes = [(0, 5.0), (scale.after(1), 10.0), (scale.after(2), 8.0)]
    sent = []
    for number in range(0, len(scale.frames), 10):
        sent.append((number, bed("Mass", [value for since, value in changes if since <= number][-1])))
    assert scale.masses(*sent) == [(1, 10.0), (2, 8.0)]


@pytest.mark.parametrize("nothing", [0.0, None])
def test_nothing_in_between_makes_an_equal_value_new(scale: Scale, nothing: float | None) -> None:
    first, second = ((scale.after(n), bed("Mass", 10.0)) for n in (1, 2))
    between = scale.after(2, -20), bed("Mass", nothing)
    assert scale.masses(first, between, second) == [(1, 10.0), (2, 10.0)]


def test_protected_message_in_kilograms(tmp_path: Path, scale: Scale) -> None:
    """A damaged frame and a repeated one count for nothing."""
    scale.path = slow_bench(tmp_path, SAFE_MASS)
    first, second = scale.after(1), scale.after(2)
    sent = [
        (first, damaged(safe_bed(0, mass=11e-6), 40)),
        (first + 1, safe_bed(1, mass=12e-6)),
        (second, safe_bed(1, mass=13e-6)),
        (second + 1, safe_bed(2, mass=14e-6)),
    ]
    assert scale.masses(*sent) == [(1, 12.0), (2, 14.0)]


def test_evaluating_a_log_compares_it(scale: Scale, tmp_path: Path) -> None:
    bench = load_bench(scale.path)
    sent = inserted(scale.frames, [(scale.after(2), bed("Mass", 8.0))])
    log = tmp_path / "bus.log"
    write_log(log, sent_log(sent))
    evaluation = evaluate(bench, [LoggedSignals(bench, log)]).evaluations[0]
    c = effective_model(bench.injector.parameters).coefficients
    injections = recording_json(evaluation, c)["injections"]
    assert [one["measured_mass_mg"] for one in injections] == [None, pytest.approx(8.0), None]
    error = 100 * (injections[1]["mass_mg"] / 8.0 - 1)
    row = next(line for line in screen_text(evaluation, c).splitlines() if line.startswith(" 2 "))
    assert {"8.00", f"{error:.2f}"} <= set(row.split())


def test_view_shows_it_beside_the_estimate(tmp_path: Path, scale: Scale) -> None:
    daemon = HeardDaemon(slow_bench(tmp_path, MASS, "[learning]\nlockstep = true"), ScriptedLink())
    at = scale.after(2, LATE)
    sent = inserted(scale.frames, [(at, bed("Mass", 7.77))])
    hand(daemon.core, sent[:at])
    assert " measured " not in daemon.drawn(80, 40)
    hand(daemon.core, sent[at:])
    daemon.core.finish()
    assert " measured " in daemon.drawn(80, 40)
    assert daemon.drawn(80, 40).count("7.77") == 1
    assert all(f" {report.mass * 1e6:.2f} " in daemon.drawn(80, 40) for report in daemon.notes.injections)
