"""A bounded folder of evidence: by kind and operating point the newest, of good events a fair sample."""

import random
import re
from collections import Counter
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from observer_rt.engine.reports.evidence import EventEvidence, EvidenceKind
from observer_rt.files.evidence.evidence_file import SUFFIX, operating_point, write_evidence
from observer_rt.foundation.outputs import replacing

_MIB = 1 << 20
_NAME = re.compile(
    rf"\.?({'|'.join(EvidenceKind)})_-?\d+MPa_\d+us_\d{{8}}T\d{{12}}(\.[0-9a-f]{{8}}\.part)?{re.escape(SUFFIX)}"
)


@dataclass(frozen=True)
class FolderLimits:
    """Bounds of a folder: MiB of all files, and how many of a kind at one operating point."""

    most_mib: float
    per_point: int


class EvidenceFolder:
    """Takes evidence in, and drops what it takes the place of; a file is whole or not there, whenever power fails."""

    def __init__(self, path: Path, limits: FolderLimits) -> None:
        """Raises OSError where the folder cannot be made."""
        path.mkdir(parents=True, exist_ok=True)
        self._path = path
        for left in self._own(f".*{SUFFIX}"):  # of a writer that was killed
            left.unlink()
        self._limits = limits
        self._seen: Counter[str] = Counter()
        self._random = random.Random()

    def take(self, evidence: EventEvidence, time: datetime) -> str:
        """Keep it, or not, of which the answer is empty; else the name of its file. time: UTC. Raises OSError."""
        cell = f"{evidence.kind}_{operating_point(evidence)}"
        there = sorted(self._own(f"{cell}_*{SUFFIX}"))  # by time
        self._seen[cell] += 1
        full = len(there) >= self._limits.per_point
        dropped = there[: len(there) - self._limits.per_point + 1]
        if full and evidence.kind is EvidenceKind.GOOD:
            place = self._random.randrange(max(self._seen[cell], len(there) + 1))
            if place >= len(there):
                return ""
            dropped = [there[place]]
        name = f"{cell}_{time:%Y%m%dT%H%M%S%f}{SUFFIX}"
        self._write(self._path / name, evidence, time)
        for file in dropped:
            file.unlink(missing_ok=True)
        self._make_room(name)
        return name

    def _write(self, target: Path, evidence: EventEvidence, time: datetime) -> None:
        with replacing(target) as part:
            write_evidence(part, evidence, time.isoformat(timespec="milliseconds"))

    def _own(self, pattern: str) -> list[Path]:
        """Files that a keeper of evidence named: no other is dropped, or counts."""
        return [path for path in self._path.glob(pattern) if _NAME.fullmatch(path.name)]

    def _make_room(self, newest: str) -> None:
        """Drop files until all fit: the oldest of whatever there is most of, the newest never."""
        sizes = {path: path.stat().st_size for path in self._own(f"*{SUFFIX}")}
        while sum(sizes.values()) > self._limits.most_mib * _MIB:
            cells = Counter(path.name.rsplit("_", 1)[0] for path in sizes if path.name != newest)
            if not cells:
                return
            most, _ = cells.most_common(1)[0]
            oldest = min(path for path in sizes if path.name.startswith(f"{most}_") and path.name != newest)
            oldest.unlink(missing_ok=True)
            del sizes[oldest]
