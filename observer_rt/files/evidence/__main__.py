"""The process that writes a daemon's evidence: events on its input, an answer a line on its output.

It is apart so that the loop never waits for a disk, and the daemon needs no library of files. It ends with its input.
"""

import os
import sys
from datetime import UTC, datetime
from json import loads
from pathlib import Path

import numpy as np

from observer_rt.engine.reports.evidence import EventEvidence
from observer_rt.files.evidence.evidence_folder import EvidenceFolder, FolderLimits
from observer_rt.foundation.errors import ObserverError

NICE = 10  # beside whoever serves a bus


def main(path: str, most_mib: str, per_point: str) -> None:
    """Write what comes until the input ends. Answers: `kept NAME`, `passed`, `failed WHY`."""
    os.nice(NICE)
    folder: EvidenceFolder | None = None
    while line := sys.stdin.buffer.readline():
        size = 3 * loads(line)["samples"] * np.dtype(np.float64).itemsize
        values = sys.stdin.buffer.read(size)
        if len(values) < size:
            return
        evidence = EventEvidence.unpacked(line, np.frombuffer(values))
        try:
            folder = folder or EvidenceFolder(Path(path), FolderLimits(float(most_mib), int(per_point)))
            name = folder.take(evidence, datetime.now(UTC))
            answer = f"kept {name}" if name else "passed"
        except OSError as error:
            answer = f"failed {error.strerror or error}"
        except ObserverError as error:
            answer = f"failed {error}"
        print(" ".join(answer.split()), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
