"""A restart in the midst of disturbed recordings changes no validity, and no mass beyond its interval."""

from pathlib import Path

import pytest

from observer_rt.config.bench import Bench
from observer_rt.daemon.persistence.state_file import load_knowledge, model_hash, save_knowledge
from observer_rt.desk.evaluation.evaluate import Evaluation, evaluate
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Reason
from observer_rt.files.replay.framing import Span
from tests.observed_plants import recording_of
from tests.plants.plant import record
from tools.benchmarks.campaign import Task
from tools.benchmarks.realism.catalogue import alone, make_realism_case, name_of, parsed
from tools.benchmarks.scoring import bench_for_case, part_of, with_signals

SEED = 1
# until an event was judged, as after every start, and at points that few events do not reach
SOON = (Reason.STARTING, Reason.TOO_FEW_EVENTS, Reason.OUTSIDE_LEARNED_RANGE)
FEW_AT_REST = ("openings_every 4.2",)  # ten openings are one event there
NAMES = sorted(name_of(entry) for entry in alone())
LARGEST = {name.rsplit(" ", 1)[0]: name for name in sorted(NAMES, key=lambda n: float(n.split(" ")[1]))}


def reports_of(found: Evaluation) -> list[InjectionReport]:
    return [each.report for each in found.injections]


def restarted(bench: Bench, knowledge: Knowledge, path: Path) -> Knowledge:
    """What a daemon that begins again finds."""
    parameters = bench.injector.parameters
    model, scale = model_hash(parameters), parameters.scaling.pressure
    save_knowledge(path, knowledge, model, scale)
    restored = load_knowledge(path, model, scale).knowledge
    assert restored is not None
    return restored


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(LARGEST.values()) - set(FEW_AT_REST)))
def test_a_restart_in_the_midst(tmp_path: Path, name: str) -> None:
    case = make_realism_case(Task(name, SEED, 0))
    bench = bench_for_case(case)
    for each in parsed(name):
        bench = with_signals(bench, each.stated)
    recording = recording_of(record(case.bench))
    whole = evaluate(bench, [recording]).evaluations[0]
    reports = reports_of(whole)
    half = next(i for i in range(len(reports) // 2, len(reports)) if reports[i].event != reports[i - 1].event)
    cut = (reports[half - 1].end_index + reports[half].start_index) // 2 - whole.first_index
    cut -= (
        cut % 2
    )  # every second sample shows the lift's zero, and a part counts anew where a device counts on
    before = evaluate(bench, [part_of(recording, Span(0, cut))])
    after = evaluate(
        bench,
        [part_of(recording, Span(cut, recording.samples))],
        restarted(bench, before.knowledge, tmp_path / "state.json"),
    )
    found = reports_of(after.evaluations[0])
    pairs = [(then, now) for then, now in zip(reports[half:], found, strict=True) if now.reason not in SOON]
    assert len(pairs) >= 0.6 * (len(reports) - half)
    assert [then.valid for then, _ in pairs] == [now.valid for _, now in pairs]
    for then, now in pairs:
        if then.mass_ci95 is not None and now.mass_ci95 is not None and now.valid:
            assert max(then.mass_ci95[0], now.mass_ci95[0]) < min(then.mass_ci95[1], now.mass_ci95[1])
