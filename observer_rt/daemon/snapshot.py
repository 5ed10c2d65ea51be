"""A daemon's state at a moment, as an object and on the control socket.

There: a line of JSON with the status, then for each injection one and its curves as float32, little-endian.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from io import BufferedIOBase
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from observer_rt.foundation.errors import RunError, UserError

SNAPSHOT = "snapshot"  # name of the request; `run`, `since` in it: daemon and last injection that the client has
KEPT = 1000  # injections
WITH_CURVES = 16  # of them, the newest
_LINE = 1 << 20  # bytes of an answer's line
_FLOAT = np.dtype("<f4")


class StatusLevel(StrEnum):
    """How well a daemon, or a part of it, is."""

    GOOD = "good"  # results can be valid
    WAITING = "waiting"  # results are not valid yet, or their level is not calibrated
    BAD = "bad"  # something is wrong


@dataclass(frozen=True)
class Fault:
    """Something that is wrong since a moment [ns since 1970]; parts: the messages it shows in, if several."""

    what: str
    since: int
    remedy: str
    parts: tuple[str, ...] = ()


@dataclass(frozen=True)
class BusStatus:
    """State of a bus. down: the reason why it is down; empty while it is up."""

    label: str
    down: str = ""


@dataclass(frozen=True)
class InputStatus:
    """An input message: how old its last frame is [s], None: none came; how late its frames come, in words."""

    text: str
    age: float | None
    is_stale: bool
    lateness: str


@dataclass(frozen=True)
class StatusLine:
    """A line that says more of a daemon."""

    text: str
    level: StatusLevel = StatusLevel.GOOD


@dataclass(frozen=True)
class Status:
    """State of a daemon.

    run: tells it from other daemons. moment: when it last looked at itself [ns since 1970]. words: state or reason
    in words. model: file in force. lost: samples and frames so far. learned: curves of the laws of nozzle and seat,
    as `LearnedLaw.columns`.
    """

    run: int
    moment: int
    state: str
    reasons: tuple[str, ...]
    words: str
    level: StatusLevel
    model: str
    lost: int = 0
    faults: tuple[Fault, ...] = ()
    buses: tuple[BusStatus, ...] = ()
    inputs: tuple[InputStatus, ...] = ()
    lines: tuple[StatusLine, ...] = ()
    learned: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True, eq=False)
class ShownInjection:
    """An injection: the n-th of the daemon's, and when it was judged [ns since 1970].

    values: by their names in the journal. references: masses [mg] it is compared with, by name. curves: by name,
    (samples,) each; none of an older one.
    """

    count: int
    moment: int
    values: Mapping[str, Any]
    references: Mapping[str, float | None] = field(default_factory=dict)
    curves: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)

    @property
    def text(self) -> dict[str, Any]:
        """All but the curves themselves, for JSON."""
        samples = next((curve.size for curve in self.curves.values()), 0)
        return {**vars(self), "curves": [*self.curves], "samples": samples}

    @property
    def data(self) -> bytes:
        """The curves."""
        return b"".join(curve.astype(_FLOAT).tobytes() for curve in self.curves.values())


@dataclass(frozen=True, eq=False)
class Snapshot:
    """State of a daemon, and its injections, the newest last."""

    status: Status
    injections: tuple[ShownInjection, ...] = ()

    def pieces(self) -> Iterator[bytes]:
        """Lines and curves of the snapshot in the order in which they go over a socket."""
        yield line_of({**asdict(self.status), "injections": len(self.injections)})
        for injection in self.injections:
            yield line_of(injection.text)
            yield injection.data


def read_snapshot(stream: BufferedIOBase) -> Snapshot:
    """Read an answer. Raises `UserError` for a daemon that refuses, `RunError` if the answer is no snapshot."""
    try:
        status = _content(stream)
        if "error" in status:
            raise UserError("snapshot", f"the daemon refuses: {status['error']}", "see the daemon's log")
        number = int(status.pop("injections"))
        return Snapshot(_STATUS.validate_python(status), tuple(_injection(stream) for _ in range(number)))
    except (ValueError, KeyError, TypeError, ValidationError):
        raise RunError("the daemon does not answer, or is of another version\n  remedy: restart it") from None


def _injection(stream: BufferedIOBase) -> ShownInjection:
    fields = _content(stream)
    names, samples = fields.pop("curves"), fields.pop("samples")
    values = np.frombuffer(stream.read(len(names) * samples * _FLOAT.itemsize), _FLOAT).reshape(len(names), samples)
    return ShownInjection(**fields, curves=dict(zip(names, values, strict=True)))


def line_of(content: Mapping[str, Any]) -> bytes:
    """A request, or an answer, as a line of JSON."""
    return json.dumps(content, allow_nan=False).encode() + b"\n"


def _content(stream: BufferedIOBase) -> dict[str, Any]:
    return dict(json.loads(stream.readline(_LINE)))


_STATUS = TypeAdapter(Status)
