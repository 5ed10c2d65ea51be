"""Evidence of events on disk, kept by a daemon for a later search of the missing effect.

An event is a Parquet file in our layout of a recording, with what was believed of it beside. A folder keeps, within
bounds, the newest events of each kind, operating point and model; of good events a fair sample of all time: those
with the lowest hash of their name, which a restart does not change.

Run as a module it is the writing process, events in, an answer a line out: the loop never waits for a disk.
"""

import hashlib
import json
import os
import re
import sys
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from observer_rt.config.injector_sections import EvidenceConfig
from observer_rt.engine.reports.evidence import EventEvidence, EvidenceKind
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.table_writers import SI, ParquetWriter
from observer_rt.foundation.errors import ObserverError, UserError
from observer_rt.foundation.files import replacing
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND

SUFFIX = ".parquet"
_BELIEF = "observer_rt_evidence"
MODEL_DIGITS = 8  # of the SHA-256 of a model, in the names of its files
_MIB = 1 << 20
_LARGEST, _MOST_SAMPLES = 64 * _MIB, 1 << 20  # of an event's file [B], far more than the observer remembers
_NAME = re.compile(
    rf"\.?({'|'.join(EvidenceKind)})_-?\d+MPa_\d+us_[0-9a-f]{{8}}_\d{{8}}T\d{{12}}"
    rf"(\.[0-9a-f]{{8}}\.part)?{re.escape(SUFFIX)}"
)
NICE = 10  # beside whoever serves a bus


class KeptEvent(NamedTuple):
    """An event that was kept, and what was believed of it; time: of the verdict, ISO 8601; sha256: of its file."""

    path: Path
    sha256: str
    kind: EvidenceKind
    time: str
    open_time: float
    opening_pressure: float
    belief: dict[str, Any]
    recording: Recording


def operating_point(evidence: EventEvidence) -> str:
    """The operating point in the name of a file: rail pressure and time open, rounded as discovery does."""
    pressure = 5 * round(evidence.opening_pressure / (5 * MEGAPASCAL))
    return f"{pressure}MPa_{100 * round(evidence.open_time / (100 * MICROSECOND))}us"


def write_evidence(path: Path, evidence: EventEvidence, time: str) -> None:
    """Write it; time: of the verdict, ISO 8601."""
    statement = {
        "kind": evidence.kind.value,
        "time": time,
        "event": evidence.event,
        "first_index": evidence.first_index,
        "opening_pressure_Pa": evidence.opening_pressure,
        "open_time_s": evidence.open_time,
        "belief": evidence.belief,
    }
    samples = (evidence.first_index + np.arange(evidence.signals.shape[1])) / evidence.sample_rate
    with ParquetWriter(path, SI[:4], {_BELIEF: json.dumps(statement)}) as writer:
        writer.write([samples, *evidence.signals])


def read_evidence(path: Path) -> KeptEvent:
    """Read an event that `write_evidence` wrote. Raises `UserError` for a damaged file, or another."""
    import pyarrow
    from pyarrow import parquet

    remedy = "move it out of the folder; the others are used"
    try:
        if not path.is_file():  # a pipe never ends
            raise ValueError
        with path.open("rb") as file:  # a name may look like an address to the library
            content = file.read(_LARGEST)
        reader = parquet.ParquetFile(pyarrow.BufferReader(content), page_checksum_verification=True)
        if reader.metadata.num_rows > _MOST_SAMPLES:  # equal ones take no room in a file
            raise ValueError
        statement = json.loads(reader.schema_arrow.metadata[_BELIEF.encode()])
        table = reader.read([column.header for column in SI[:4]])
        time, rail, lift, line = (column.to_numpy() for column in table.columns)
        recording = Recording(time, rail, lift, line, path=path)
        kind, judged, belief = EvidenceKind(statement["kind"]), str(statement["time"]), dict(statement["belief"])
        open_time, pressure = float(statement["open_time_s"]), float(statement["opening_pressure_Pa"])
        sha256 = hashlib.sha256(content).hexdigest()
        return KeptEvent(path, sha256, kind, judged, open_time, pressure, belief, recording)
    except OSError as error:  # also of a page whose checksum is another
        raise UserError(str(path), f"is damaged: {error}", remedy) from None
    except (pyarrow.ArrowException, KeyError, ValueError, TypeError, RecursionError):
        raise UserError(str(path), "is no evidence kept by `observer-rt run`", remedy) from None


class EvidenceFolder:
    """Keeps evidence, and deletes what it replaces. After a power failure each file is either whole or absent."""

    def __init__(self, path: Path, limits: EvidenceConfig) -> None:
        """Raises OSError where the folder cannot be made."""
        path.mkdir(parents=True, exist_ok=True)
        self._path = path
        for left in self._own(f".*{SUFFIX}"):  # of a writer that was killed
            left.unlink()
        self._limits = limits

    def take(self, evidence: EventEvidence, time: datetime) -> str:
        """Keep an event; returns the name of its file, empty if it is not kept. time: UTC. Raises OSError."""
        self._path.mkdir(parents=True, exist_ok=True)  # somebody may have removed it
        cell = f"{evidence.kind}_{operating_point(evidence)}_{evidence.belief['model_sha256'][:MODEL_DIGITS]}"
        name = f"{cell}_{time:%Y%m%dT%H%M%S%f}{SUFFIX}"
        kept = [path.name for path in self._own(f"{cell}_*{SUFFIX}")]
        kept_names = _kept_names([*kept, name], self._limits.per_point)
        if name not in kept_names:
            return ""
        with replacing(self._path / name) as part:
            write_evidence(part, evidence, time.isoformat(timespec="milliseconds"))
        for dropped in set(kept) - set(kept_names):
            (self._path / dropped).unlink(missing_ok=True)
        self._make_room(name)
        return name

    def _own(self, pattern: str) -> list[Path]:
        """Files that carry a name of evidence; others are neither counted nor deleted."""
        return [path for path in self._path.glob(pattern) if _NAME.fullmatch(path.name)]

    def _make_room(self, newest: str) -> None:
        """Delete files until the rest fits, from the cell that has most of them; never the newest file."""
        sizes = {path: path.stat().st_size for path in self._own(f"*{SUFFIX}")}
        while sum(sizes.values()) > self._limits.most_mib * _MIB:
            cells = Counter(path.name.rsplit("_", 1)[0] for path in sizes if path.name != newest)
            if not cells:
                return
            most, count = cells.most_common(1)[0]
            names = [path.name for path in sizes if path.name.startswith(f"{most}_") and path.name != newest]
            (dropped,) = set(names) - set(_kept_names(names, count - 1))
            (self._path / dropped).unlink(missing_ok=True)
            del sizes[self._path / dropped]


def _kept_names(names: list[str], most: int) -> list[str]:
    """The newest, or those of good events with the lowest hash, `most` of them."""
    if names[0].startswith(f"{EvidenceKind.GOOD}_"):
        return sorted(names, key=lambda name: hashlib.sha256(name.encode()).digest())[:most]
    return sorted(names, reverse=True)[:most]


def main(path: str, most_mib: str, per_point: str) -> None:
    """Write what comes until the input ends. Answers: `kept NAME`, `passed`, `failed WHY`."""
    os.nice(NICE)
    folder: EvidenceFolder | None = None
    limits = EvidenceConfig(most_mib=float(most_mib), per_point=int(per_point))
    while line := sys.stdin.buffer.readline():
        size = 3 * json.loads(line)["samples"] * np.dtype(np.float64).itemsize
        values = sys.stdin.buffer.read(size)
        if len(values) < size:
            return
        evidence = EventEvidence.unpacked(line, np.frombuffer(values))
        try:
            folder = folder or EvidenceFolder(Path(path), limits)
            name = folder.take(evidence, datetime.now(UTC))
            answer = f"kept {name}" if name else "passed"
        except (OSError, ObserverError) as error:
            answer = f"failed {getattr(error, 'strerror', None) or error}"
        print(" ".join(answer.split()), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
