"""Injections on their way from the loop to the journal."""

import time
from collections import deque
from dataclasses import replace
from pathlib import Path

from observer_rt import __version__
from observer_rt.config.bench import Bench
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.model.effects import effective_model
from observer_rt.service.keeping.chore import Tell
from observer_rt.service.keeping.journal import Journal, MassRow, Run
from observer_rt.service.keeping.journal_columns import row_of, utc
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass, News
from observer_rt.service.state_file import model_hash

BATCH = 500  # entries in one transaction
MOST_WAITING = 10_000  # entries, some minutes of a full disk; those beyond are lost


class Notebook:
    """Listens in the loop, where it only keeps what it hears; writes it into the journal from another thread."""

    def __init__(self, path: Path, bench: Bench, tell: Tell) -> None:
        """Raises `UserError` for a file that is no journal."""
        self.name = f"journal {path}"
        self.lost = 0
        """Injections and measured masses for which there was no room."""
        self.written = 0
        """Injections on disk."""
        self._path = path
        self._tell = tell
        self._told_lost = 0
        self._c = effective_model(bench.injector.parameters).coefficients
        self._journal = Journal(path, _run(bench))
        self._waiting: deque[tuple[int, InjectionReport | MassRow]] = deque()  # with Unix time, ns
        self._is_begun = False

    def __call__(self, news: News) -> None:
        """Keep what belongs into the journal."""
        match news:
            case InjectionReport():
                entry: InjectionReport | MassRow = replace(news, rate_sigma=None)  # an array, for nobody here
            case MeasuredMass():
                entry = MassRow(news.report.number, news.mass / MILLIGRAM)
            case _:
                return
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append((time.time_ns(), entry))
        else:
            self.lost += 1

    def write(self) -> None:
        """Write what waits; begun with nothing, the run itself. Raises `RunError`; what is not written waits on."""
        self._tell_lost()
        while True:
            # by index: the loop may add more meanwhile
            batch = [self._waiting[i] for i in range(min(len(self._waiting), BATCH))]
            if not batch and self._is_begun:
                return
            reports = [(at, entry) for at, entry in batch if isinstance(entry, InjectionReport)]
            # made one by one, so that the loop gets its turn between two of them
            rows = (row_of(report, self._c, at) for at, report in reports)
            self._journal.write(rows, [entry for _, entry in batch if isinstance(entry, MassRow)])
            self._is_begun = True
            for _ in batch:
                self._waiting.popleft()
            self.written += len(reports)

    def finish(self) -> str:
        """Write what waits and the clean stop."""
        self.write()
        self._journal.close(utc(time.time_ns()))
        return f"{self.written} injections in the journal {self._path}"

    def _tell_lost(self) -> None:
        """Say it where there is something new to say."""
        if self.lost != self._told_lost:
            self._told_lost = self.lost
            self._tell(
                f"warning: {self.name}: {self.lost} injections lost so far, for want of room to keep them"
            )


def _run(bench: Bench) -> Run:
    now = time.time_ns()
    fitted = bench.injector
    return Run(
        started_unix_us=now // 1000,
        started_utc=utc(now),
        software_version=__version__,
        model_sha256=model_hash(fitted.parameters),
        injector=fitted.name,
        bench_file=str(bench.path.absolute()),
        configuration_json=fitted.config.model_dump_json(),
    )
