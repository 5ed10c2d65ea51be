"""Learns for an amended model before it is taken over, from the events that were kept with the model in force.

The first injection with it is then estimated as well as the last one before.
"""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench, BenchInjector, load_injector
from observer_rt.config.channels import as_observed
from observer_rt.daemon.persistence.state_file import learned_beside, model_hash, save_knowledge
from observer_rt.desk.evaluation.evaluate import evaluate_stream
from observer_rt.files.evidence.evidence_file import KeptEvent
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.identification.likelihood.kept_events import read_folder

MOST = 100  # events, the newest; a hundredth of a second each


def learn_beforehand(bench: Bench, amended: Path) -> int:
    """Learn for an amended injector file from the evidence; from how many events, 0: there is nothing to begin with.

    bench: with one injector, and the model before in force. What was learned is written beside the amended file,
    where a daemon looks for it; nothing is where the amended model does not explain the last of the events.
    """
    state_file = learned_beside(amended)
    with file_errors(state_file):
        state_file.unlink(missing_ok=True)
    parameters, learning = load_injector(amended), bench.injector.config.learning.enabled
    mended = bench.with_sections(signals=as_observed(bench.injector.config.signals))
    try:
        events = [HeldSignals(event.recording) for event in _kept_with(bench.injector)]
        if not events:
            return 0
        evaluations, knowledge = evaluate_stream(
            mended.with_parameters(parameters), events, learning=learning
        )
    except UserError:  # no evidence, or of another sample rate
        return 0
    judged = [injection.report for each in evaluations for injection in each.injections]
    if not (knowledge.state.events and judged[-1].valid):
        return 0
    save_knowledge(state_file, knowledge, parameters)
    return knowledge.state.events


def _kept_with(fitted: BenchInjector) -> Sequence[KeptEvent]:
    """Events that were kept with this model, the oldest first. Raises `UserError` for a folder without any.

    None where the bench measures the fuel's temperature, which evidence does not hold.
    """
    if fitted.evidence is None or fitted.config.signals.fuel_temperature is not None:
        return ()
    model = model_hash(fitted.parameters)
    kept = read_folder(fitted.evidence, Console(quiet=True))
    return [one for one in kept if one.belief["model_sha256"] == model][-MOST:]
