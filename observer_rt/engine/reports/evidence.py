"""Evidence: inputs of an event as the observer saw them, and its verdict, for `discover --from-evidence`."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple, Self

import numpy as np

from observer_rt.core.stream.stream import RING
from observer_rt.engine.observer import remembered
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import LIFT, LINE, RAIL, Constants, Observer, Reason
from observer_rt.engine.stream.validity import OF_MODEL
from observer_rt.foundation.units import Z_95, Floats

LEAD = 4e-3  # s of shut needle kept before an event, in which a model that is run along it settles
TAIL = 14e-3  # s of ringing kept after it
WIDE = 0.01  # of the mass: a wider interval makes an event doubtful
_UNSURE = {Reason.OUTSIDE_LEARNED_RANGE, Reason.LEARNING_LATE}
_OF_KNOWLEDGE = {Reason.TOO_FEW_EVENTS, Reason.UNTESTED, *_UNSURE}
"""Reasons that say nothing against the inputs."""


class EvidenceKind(StrEnum):
    """Kind of evidence that an event is."""

    REFUSED = "refused"
    """It contradicts the model, or what was learned."""
    DOUBTFUL = "doubtful"
    """Its rate and mass are uncertain."""
    GOOD = "good"
    """It has no objection."""


def kind_of(reports: Iterable[InjectionReport]) -> EvidenceKind | None:
    """The kind of an event by its injections; None where its inputs themselves are in doubt."""
    reports = tuple(reports)
    reasons = {reason for report in reports for reason in report.reasons}
    if reasons & OF_MODEL:
        return EvidenceKind.REFUSED
    if reasons - _OF_KNOWLEDGE:
        return None
    is_wide = any(report.valid and not Z_95 * report.relative_sigma <= WIDE for report in reports)
    if is_wide or reasons & _UNSURE:
        return EvidenceKind.DOUBTFUL
    return EvidenceKind.GOOD


@dataclass(frozen=True, eq=False)
class EventEvidence:
    """An event's inputs on its grid, and what was believed of it."""

    kind: EvidenceKind
    event: int  # its number since the observer started
    first_index: int  # device index of the first sample
    sample_rate: float  # Hz
    opening_pressure: float  # rail pressure at the opening [Pa]
    open_time: float  # for which the needle is open, all injections together [s]
    belief: dict[str, Any]  # JSON: model, verdict, masses and indicators of its injections
    signals: Floats  # (3, n) rail pressure [Pa], needle lift [m], line pressure [Pa]; nan: did not count

    def packed(self) -> bytes:
        """A line of JSON, followed by the signals as float64, for `unpacked`."""
        said = {name: value for name, value in vars(self).items() if name != "signals"}
        return json.dumps({**said, "samples": self.signals.shape[1]}).encode() + b"\n" + self.signals.tobytes()

    @classmethod
    def unpacked(cls, line: bytes, values: Floats) -> Self:
        """Evidence from its line of JSON and its three signals one after another (3 n,)."""
        said = json.loads(line)
        del said["samples"]
        return cls(**said | {"kind": EvidenceKind(said["kind"]), "signals": values.reshape(3, -1)})


class EventInputs(NamedTuple):
    """Inputs around an event, copied from the ring: position and device index of the first sample, signals (3, n)."""

    start: int
    first_index: int
    signals: Floats


def event_inputs(observer: Observer, start: int, end: int) -> EventInputs:
    """Inputs at the positions [start, end) that are remembered, from the last break before `start` + LEAD on.

    Values that did not count are nan. Effects of the rail sensor that are in force are not applied.
    """
    constants = observer.constants
    c = constants.coefficients
    start, lead = max(start, end - RING, 0), round(LEAD / constants.interval)
    broken = np.flatnonzero(remembered(observer.ring["broken"], start, min(start + lead, end)))
    start += int(broken[-1]) if broken.size else 0
    bridged = remembered(observer.ring["bridged"], start, end)

    def counted(values: Floats, channel: int) -> Floats:
        return np.where(bridged & (1 << channel), np.nan, values)

    rail, line = (
        remembered(observer.ring[name], start, end) * c.pressure_scale + c.chamber_pressure
        for name in ("rail_pressure", "line_pressure")
    )
    rail = (rail - constants.inputs.rail_shift) / constants.inputs.rail_factor
    lift = remembered(observer.ring["needle_lift"], start, end)
    later = remembered(observer.ring["lift_after"], start, end)
    lift = lift - later * np.diff(lift, prepend=lift[:1])  # interpolated to the time of the other two
    return EventInputs(
        start,
        int(observer.ring["index"][start % RING]),
        np.stack((counted(rail, RAIL), counted(lift, LIFT), counted(line, LINE))),
    )


def evidence_of(
    reports: Sequence[InjectionReport], inputs: EventInputs, constants: Constants, belief: dict[str, Any]
) -> EventEvidence | None:
    """Evidence of an event with these injections; None where none is to be kept."""
    kind = kind_of(reports)
    if kind is None:
        return None
    timing, interval = constants.timing, constants.interval
    margin = len(reports) * (timing.window_lead + timing.window_tail)
    end = reports[-1].end_position - timing.window_tail + round(TAIL / interval)
    return EventEvidence(
        kind=kind,
        event=reports[0].event,
        first_index=inputs.first_index,
        sample_rate=1.0 / interval,
        opening_pressure=reports[0].rail_pressure,
        open_time=max(sum(one.end_position - one.start_position for one in reports) - margin, 0) * interval,
        belief=belief,
        signals=inputs.signals[:, : end - inputs.start],
    )
