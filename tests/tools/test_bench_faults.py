"""The table of faults: the same by their seed, wrong only where they are said to be, and wrong is found."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import SignalConfig
from observer_rt.core.frames.frames import SUPERVISION, status_of_frame
from observer_rt.engine.stream.state import Reason
from observer_rt.files.replay.framing import Framer, all_samples
from tests.observed_plants import recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import SIGNALS, Bench, Event, Needle, Outcome, Shot, record
from tools.benchmarks.campaign import Row, frame_of, judged, table
from tools.benchmarks.faults import frames as frame_faults
from tools.benchmarks.faults.command import BARS, COLUMNS
from tools.benchmarks.faults.fault import PlacedFault, Sent, Where
from tools.benchmarks.faults.frames import with_frame_fault
from tools.benchmarks.faults.player import Results, Summary
from tools.benchmarks.faults.scenario import Scenario, Task, drawn, entries, tasks
from tools.benchmarks.faults.score import facts_of
from tools.benchmarks.faults.table import TABLE

BEGIN, END = 0.30, 0.40  # s
EVENTS = tuple(Event((80 + 10 * n) * 1e6, (Shot(0.0, 1.5e-3),), Faults()) for n in range(6))
BENCH = Bench(Injector(), Needle(), EVENTS, seed=3)
SENSORS = [name for name, row in TABLE.items() if row.where is Where.SENSOR and name != "none"]


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    return record(BENCH)


def placed(name: str) -> PlacedFault:
    return PlacedFault(TABLE[name], TABLE[name].sizes[-1], BEGIN, END, seed=7)


@pytest.mark.parametrize("name", SENSORS)
def test_signals_change_while_the_fault_is_there(outcome: Outcome, name: str) -> None:
    before, after = outcome.measured, record(placed(name).on(BENCH)).measured
    during = (before.time >= BEGIN) & (before.time < END)
    changed = [~np.equal(getattr(after, role), getattr(before, role)) for role in SIGNALS]
    assert not any(each[~during].any() for each in changed)
    assert any(each[during].any() for each in changed)


@pytest.mark.parametrize("name", [row.name for row in frame_faults.ROWS])
def test_frames_change_from_the_fault_on_and_bear_right_check_sums(outcome: Outcome, name: str) -> None:
    bus = map_bus(load_bench())
    recording = recording_of(outcome)
    frames = [Sent(f.time, f.time, 0, f.payload) for f in Framer(bus).frames(recording, all_samples(recording))]
    changed = with_frame_fault(frames, placed(name), bus)
    assert [f for f in changed if f.time < BEGIN] == [f for f in frames if f.time < BEGIN]
    assert changed != frames
    message, payloads = bus.inputs.messages[0], [np.frombuffer(f.payload, np.uint8) for f in changed]
    worth = {status_of_frame(payload, message, np.zeros(1, SUPERVISION)) for payload in payloads}
    assert (4 in worth) == (name == "wrong_crc")  # E2E_CRC_ERROR


def test_scenarios_are_the_same_by_their_seed() -> None:
    names = entries(TABLE)
    drawn_tasks = tasks(TABLE, names, len(names), 5)
    assert drawn_tasks == tasks(TABLE, names, len(names), 5)
    assert drawn_tasks != tasks(TABLE, names, len(names), 6)
    assert {placement.class_name.split(" ")[0] for placement in drawn_tasks} == set(TABLE)
    for task in drawn_tasks:
        scenario = drawn(task, TABLE, is_rich=False)
        assert scenario.placed == drawn(task, TABLE, is_rich=False).placed
        for placement in scenario.placed:
            assert {key for keys in placement.stated.values() for key in keys} <= set(SignalConfig.model_fields)


def test_every_reason_that_may_be_true_is_one_of_the_observer() -> None:
    assert {name for row in TABLE.values() for name in row.reasons} <= set(Reason.__members__)


def scored(outcome: Outcome, factor: float, is_valid: bool = True, late: float = 0.0) -> Row:
    """Of a publisher that is `factor` times right from the fault on."""
    time, truth = outcome.measured.time, outcome.truth.injection_rate
    rate = np.where(time >= BEGIN, factor, 1.0) * truth
    published = Results(rate, np.where(time >= BEGIN, is_valid, True))
    fault = replace(TABLE["drift_line"], late=late)
    task = Task("drift_line 4", 1, 0)
    scenario = Scenario(task, BENCH, (PlacedFault(fault, 4.0, BEGIN, END, 1),), True, False)
    for opening in outcome.openings:
        window = slice(opening[0], opening[1] + 50)
        mass = float(np.trapezoid(rate[window])) * 1e-5 * Injector().density
        published.summaries.append(Summary(int(opening[0]), bool(published.valid[opening[0]]), mass, "NONE"))
    return facts_of(scenario, outcome, published)


def test_right_is_right(outcome: Outcome) -> None:
    row = scored(outcome, 1.01)
    assert (row["is_wrong"], row["found_ms"], row["recovered_after"]) == (False, None, 1)
    assert all(row["free_valid"])


def test_wrong_while_valid_is_found_but_for_the_stated_time(outcome: Outcome) -> None:
    all_of_it, later = scored(outcome, 1.05), scored(outcome, 1.05, late=20e-3)
    assert all_of_it["wrong_samples"] > later["wrong_samples"] > 0
    assert later["late_samples"] == all_of_it["wrong_samples"] - later["wrong_samples"]
    assert later["wrong_summaries"] == all_of_it["wrong_summaries"] > 0


def test_figures_are_of_all_scenarios(outcome: Outcome) -> None:
    refused = scored(outcome, 1.5, is_valid=False)
    assert (refused["is_wrong"], refused["recovered_after"], refused["found_ms"]) == (False, None, 0.0)
    frame = frame_of([scored(outcome, 1.01), scored(outcome, 1.05), refused])
    verdict = judged(frame, BARS)
    assert verdict.loc["wrong_valid_samples", "value"] == scored(outcome, 1.05)["wrong_samples"]
    assert verdict.loc["recovery_injections_max", "value"] == 1
    assert {"wrong_valid_samples", "wrong_summaries"} <= set(verdict.index[verdict["met"].eq(False)])
    assert table(frame, "fault", COLUMNS).index.tolist() == ["drift_line", "all"]
