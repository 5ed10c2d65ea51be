"""Scenarios of faults: the same by their seed, what goes wrong is where it is said to be, and wrong is found."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.core.frames.frames import check_frame
from observer_rt.files.replay.framing import Framer, whole
from tests.observed_plants import recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import SIGNALS, Bench, Event, Needle, Outcome, Shot, record
from tools.benchmarks.campaign import Task
from tools.benchmarks.faults import bus as bus_faults
from tools.benchmarks.faults import inputs
from tools.benchmarks.faults.bus import Sent, with_bus_fault
from tools.benchmarks.faults.inputs import with_input_fault
from tools.benchmarks.faults.player import Published, Summary
from tools.benchmarks.faults.run import KINDS, score_scenario
from tools.benchmarks.faults.scenario import Placed, Scenario, drawn, tasks
from tools.benchmarks.faults.score import RECOVERY, FaultScore, score

BEGIN, END = 0.30, 0.40  # s


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    events = tuple(Event(100e6, (Shot(0.0, 1.5e-3),), Faults()) for _ in range(6))
    return record(Bench(Injector(), Needle(), events, seed=3))


def placed(name: str) -> Placed:
    return Placed(KINDS[name], BEGIN, END, seed=7)


@pytest.mark.parametrize("name", [kind.name for kind in inputs.KINDS])
def test_input_changes_while_the_fault_lasts(outcome: Outcome, name: str) -> None:
    before = outcome.measured
    after = with_input_fault(before, placed(name))
    during = (before.time >= BEGIN) & (before.time < END)
    changed = [~np.equal(getattr(after, role), getattr(before, role)) for role in SIGNALS]
    assert not any(each[~during].any() for each in changed)
    assert any(each[during].any() for each in changed)


@pytest.mark.parametrize("name", [kind.name for kind in bus_faults.KINDS])
def test_frames_change_from_the_fault_on_and_bear_right_check_sums(outcome: Outcome, name: str) -> None:
    bus = map_bus(load_bench())
    recording = recording_of(outcome)
    frames = [Sent(f.time, f.time, 0, f.payload) for f in Framer(bus).frames(recording, whole(recording))]
    found = with_bus_fault(frames, placed(name), bus)
    assert [f for f in found if f.time < BEGIN] == [f for f in frames if f.time < BEGIN]
    assert found != frames
    layout = bus.input_layouts[0]
    wrong = [
        f
        for f in found
        if not check_frame(np.frombuffer(f.payload, np.uint8), layout.length, layout.protection)
    ]
    assert bool(wrong) == (name == "wrong_crc")


def test_scenarios_are_the_same_by_their_seed() -> None:
    names = tuple(KINDS)
    found = tasks(names, 60, 5)
    assert found == tasks(names, 60, 5)
    assert found != tasks(names, 60, 6)
    assert {each.class_name.split(" + ")[0] for each in found} == set(names)
    assert drawn(found[0], KINDS, is_rich=False) == drawn(found[0], KINDS, is_rich=False)


def scored(outcome: Outcome, factor: float, is_valid: bool = True, late: float = 0.0) -> FaultScore:
    """Of a publisher that is `factor` times right from the fault on."""
    time, truth = outcome.measured.time, outcome.truth.injection_rate
    rate = np.where(time >= BEGIN, factor, 1.0) * truth
    published = Published(rate, np.where(time >= BEGIN, is_valid, True))
    kind = replace(KINDS["drift_line"], late=late)
    bench = Bench(Injector(), Needle(), (), seed=3)
    scenario = Scenario(Task("drift_line", 1, 0), bench, (Placed(kind, BEGIN, END, 1),), True, False)
    for opening in outcome.openings:
        window = slice(opening[0], opening[1] + 50)
        mass = float(np.trapezoid(rate[window])) * 1e-5 * Injector().density
        published.summaries.append(Summary(int(opening[0]), bool(published.valid[opening[0]]), mass, "NONE"))
    return score(scenario, outcome, published, Injector().density)


def test_right_is_right(outcome: Outcome) -> None:
    found = scored(outcome, 1.01)
    assert (found.wrong_samples, found.wrong_summaries, found.found_after) == (0, 0, None)
    assert (found.recovered_after, found.free_valid) == (1, found.free)


def test_wrong_while_valid_is_found_but_for_the_stated_time(outcome: Outcome) -> None:
    all_of_it, later = scored(outcome, 1.05), scored(outcome, 1.05, late=20e-3)
    assert all_of_it.wrong_samples > later.wrong_samples > 0
    assert later.late_samples == all_of_it.wrong_samples - later.wrong_samples
    assert later.wrong_summaries == all_of_it.wrong_summaries > 0


def test_wrong_and_not_valid_is_not_wrong(outcome: Outcome) -> None:
    found = scored(outcome, 1.5, is_valid=False)
    assert (found.wrong_samples, found.wrong_summaries, found.recovered_after) == (0, 0, None)
    assert found.found_after == 0.0


PLAYED = (
    Task("frozen_line", 3, 0),
    Task("killed_and_restarted", 3, 0),
    Task("learner_failing", 3, 0),
    Task("wrong_crc", 3, 0),
    Task("unit_line", 3, 0),
    Task("swapped_pressures", 3, 0),
    Task("drift_needle", 3, 0),
    # once wrong while valid, or too long not valid
    Task("unavailable_rail", 20311202, 3),
    Task("step_line", 20311202, 143),
    Task("unit_needle + step_needle", 20311202, 148),
    Task("device_restart + step_line + clipped_rail", 20311202, 332),
    Task("step_rail + clipped_needle + step_line", 20311301, 267),
)


@pytest.mark.slow
@pytest.mark.parametrize("task", PLAYED, ids=lambda task: task.class_name)
def test_service_goes_through_a_fault_and_recovers(task: Task) -> None:
    found = score_scenario(None, task)
    assert not found.crash
    assert (found.wrong_samples, found.wrong_summaries) == (0, 0)
    assert found.is_named is not False
    assert found.recovered_after is not None
    assert found.recovered_after <= RECOVERY
