"""What the cyclic status frame says."""

from typing import NamedTuple

from observer_rt import __version__
from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.core.core import Core


class OutsideFigures(NamedTuple):
    """What the status says of links and files: frames lost before the loop, how often a link was in trouble, which.

    troubled_bus: the first that is, counted from 1; 0: none. foreign_frames: of others under our identifiers; the
    ages [s] of the last frames, nan: none came. failed_writes: of what the daemon keeps, and of its log.
    """

    dropped_frames: int
    link_troubles: int
    troubled_bus: int
    foreign_frames: int
    rail_pressure_age: float
    needle_lift_age: float
    line_pressure_age: float
    failed_writes: int


def software_version() -> tuple[int, int, int]:
    """Major, minor and patch number of this software."""
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    return major, minor, patch


def status_values(
    core: Core, state: State, reason: Reason, injector_id: int, hashes: tuple[int, int], link: OutsideFigures
) -> StatusValues:
    """What the status says, every counter that it has a signal for included.

    hashes: of model and bus databases (first 32 bits).
    """
    counters = core.counters
    major, minor, patch = software_version()
    model_hash, database_hash = hashes
    valid = core.processed > 0 and bool(core.rows(core.processed - 1, core.processed)["valid"][0])
    return StatusValues(
        sample_index=core.last_index & 0xFFFFFFFF,
        valid=valid and state in (State.RUNNING_NOMINAL, State.ADAPTED),
        learning=core.learning,
        state=state,
        reason=reason,
        injector_id=injector_id,
        version_major=major,
        version_minor=minor,
        version_patch=patch,
        model_hash=model_hash,
        database_hash=database_hash,
        samples_processed=counters.samples & 0xFFFFFFFF,
        **link._asdict(),
        **{name: count for name, count in vars(counters).items() if name in StatusValues._fields},
    )
