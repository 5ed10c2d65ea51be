"""Evidence that a daemon kept, joined to one recording: events of the most telling kind that has enough of them."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from observer_rt.config.injector_sections import Meaning
from observer_rt.engine.reports.evidence import EvidenceKind
from observer_rt.files.evidence_folder import SUFFIX, KeptEvent, read_evidence
from observer_rt.foundation.console import say
from observer_rt.foundation.errors import UserError
from observer_rt.identification.likelihood.measurement import Measurement, joined, measurements
from observer_rt.identification.likelihood.reading import refuse_sample_rates
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import VOCABULARY

FEWEST_EVENTS = 3  # events of a kind that a search can work with


@dataclass(frozen=True, eq=False)
class KeptEvidence:
    """Events of one model and kind, joined to a measurement; hashes: one SHA-256 of the files, by their folder."""

    model_sha256: str
    injector_file: Path
    measurement: Measurement
    hashes: dict[str, str]


def read_folder(folder: Path, console: Console) -> tuple[KeptEvent, ...]:
    """Events in a folder in the order of time, without damaged files. Raises `UserError` without any."""
    events: list[KeptEvent] = []
    dropped = 0
    paths = sorted(folder.glob(f"*{SUFFIX}"), key=lambda path: path.stem.rsplit("_", 1)[-1])
    for path in paths:
        try:
            events.append(read_evidence(path))
        except UserError as error:
            if path.exists():
                say(console, f"warning: {error.location} is left out: {error.problem}")
            else:
                dropped += 1
    if dropped:
        say(console, f"{folder}: {dropped} events were dropped for newer ones before they were read")
    if not events:
        problem = "holds no evidence" if folder.is_dir() else "is no folder"
        remedy = 'state [evidence] folder = "..." in the bench file, and let `observer-rt run` see some injections'
        raise UserError(f"--from-evidence {folder}", problem, remedy)
    return tuple(events)


def evidence_of_model(
    events: Sequence[KeptEvent], folder: Path, model_sha256: str | None, console: Console
) -> KeptEvidence:
    """A model's refused events, or if they are too few the doubtful ones, or else the good ones.

    model_sha256: None for that of the newest event. Raises `UserError` for too little evidence.
    """
    option = f"--from-evidence {folder}"
    model = model_sha256 or str(events[-1].belief["model_sha256"])
    own = [event for event in events if event.belief["model_sha256"] == model]
    if not own:
        remedy = f"give the model that was in force by --model: {events[-1].belief['injector_file']}"
        raise UserError(option, "was kept with another model than this one", remedy)
    for kind in EvidenceKind:
        chosen = [event for event in own if event.kind is kind]
        if len(chosen) >= FEWEST_EVENTS:
            break
    else:
        problem = f"holds fewer than {FEWEST_EVENTS} events of a kind"
        raise UserError(option, problem, "let the observer see more injections")
    others = {other: sum(event.kind is other for event in own) for other in EvidenceKind if other is not kind}
    counts = ", ".join(f"{count} {other}" for other, count in others.items())
    say(console, f"{folder}: {len(chosen)} {kind} events are searched ({counts} events are not)")
    digests = "".join(sorted(event.sha256 for event in chosen))  # the same in any order
    hashes = {str(folder): hashlib.sha256(digests.encode()).hexdigest()}
    return KeptEvidence(model, Path(chosen[-1].belief["injector_file"]), _measured(chosen, folder), hashes)


def _measured(events: Sequence[KeptEvent], folder: Path) -> Measurement:
    """Events of one model as a measurement. Raises `UserError` for different sample rates."""
    recordings, belief = [event.recording for event in events], events[-1].belief
    refuse_sample_rates(recordings)
    names = ("rail_pressure", "needle_lift", "line_pressure")
    parts = [{name: recording.arrays[name] for name in names} for recording in recordings]
    meaning = Meaning(belief["meaning"])
    (measurement,) = measurements([joined(parts, recordings[0].sample_rate, path=folder, meaning=meaning)])
    # of the line pressure; the samples are already corrected by the delays and lags of other channels
    stated = (SizedEffect(VOCABULARY[name], tuple(values)) for name, values in belief["line_sensor"].items())
    return replace(measurement, stated=tuple(stated))
