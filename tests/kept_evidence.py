"""Evidence in a folder, kept as a daemon keeps it, of recordings that a core observes in lockstep."""

from collections.abc import Iterator
from contextlib import contextmanager

from observer_rt.config.bench import Bench
from observer_rt.daemon.evidence_keeper import EvidenceKeeper, evidence_keeper
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.signals.recording import Recording
from observer_rt.model.effect import SizedEffect
from tests.daemon.participants import until
from tests.device import core_of, frames_of, hand


@contextmanager
def keeping(bench: Bench, messages: list[str]) -> Iterator[EvidenceKeeper]:
    folder = bench.injector.evidence
    assert folder is not None
    with evidence_keeper(bench.injector, folder, messages.append) as keeper, keeper.keeping():
        yield keeper


def observe(keeper: EvidenceKeeper, bench: Bench, recording: Recording) -> None:
    core = core_of(bench, listeners=[keeper.hear])
    keeper.watch(core)
    hand(core, frames_of(bench, recording))
    core.finish()


def keep(bench: Bench, *hidden: SizedEffect, injections: int = 12) -> None:
    """Keep the evidence of an injector with hidden effects, at three rail pressures and two durations."""
    schedule = make_schedule([60e6, 100e6, 140e6], injections, 0.05, [0.9e-3, 1.9e-3])
    rate = bench.injector.sample_rate
    measured = simulate(bench.injector.parameters, schedule, rate, hidden, SimulatedNoise(), seed=4)
    messages: list[str] = []
    with keeping(bench, messages) as keeper:
        observe(keeper, bench, measured.recording)
        until(lambda: keeper.kept + keeper.lost >= injections - 1)  # of which the last is handed on at the end
    assert (keeper.kept, messages) == (injections, [])
