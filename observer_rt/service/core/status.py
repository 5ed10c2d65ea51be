"""What the cyclic status frame says."""

from typing import NamedTuple

from observer_rt import __version__
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.core.core import Core


class LinkFigures(NamedTuple):
    """What the status says of the links: frames lost before the loop, how often they were in trouble, and which is.

    troubled_bus: the first that is, counted from 1; 0: none.
    """

    dropped: int
    troubles: int
    troubled_bus: int


def software_version() -> tuple[int, int, int]:
    """Major, minor and patch number of this software."""
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    return major, minor, patch


def status_values(
    core: Core, state: State, reason: Reason, injector_id: int, hashes: tuple[int, int], link: LinkFigures
) -> dict[str, float]:
    """Signals of `ObserverStatus`; hashes of model and bus databases (first 32 bits)."""
    counters = core.counters
    major, minor, patch = software_version()
    model_hash, database_hash = hashes
    valid = core.processed > 0 and bool(core.rows(core.processed - 1, core.processed)["valid"][0])
    return {
        "SampleIndex": core.last_index & 0xFFFFFFFF,
        "Valid": valid and state in (State.RUNNING_NOMINAL, State.ADAPTED),
        "Learning": core.learning,
        "State": state,
        "Reason": reason,
        "InjectorId": injector_id,
        "VersionMajor": major,
        "VersionMinor": minor,
        "VersionPatch": patch,
        "ModelHash": model_hash,
        "DatabaseHash": database_hash,
        "SamplesProcessed": counters.samples & 0xFFFFFFFF,
        "LostSamples": counters.lost_samples,
        "InterpolatedSamples": counters.interpolated_samples,
        "CrcErrors": counters.crc_errors,
        "SequenceErrors": counters.sequence_errors,
        "LengthErrors": counters.length_errors,
        "RepeatedFrames": counters.repeated_frames,
        "OldFrames": counters.old_frames,
        "DroppedFrames": link.dropped,
        "LinkTroubles": link.troubles,
        "TroubledBus": link.troubled_bus,
        "Restarts": counters.restarts,
        "Adoptions": counters.adoptions,
        "RejectedAdoptions": counters.rejected_adoptions,
        "LateAdoptions": counters.late_adoptions,
        "MissingInjections": counters.missing_injections,
        "UncommandedInjections": counters.uncommanded_injections,
    }
