"""Log of the service, to stderr, a file, stdout and systemd. No line of it ever holds up the loop."""

import json
import logging
import math
import os
import queue
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from datetime import UTC, datetime
from functools import partial
from logging.handlers import WatchedFileHandler
from pathlib import Path
from typing import IO, Any, TextIO

from rich.console import Console

from observer_rt.config.signals import in_words
from observer_rt.daemon.notifier import Notifier
from observer_rt.engine.estimation.parameters import NOZZLE, OFFSET
from observer_rt.engine.reports.injection_report import InjectionReport, beyond_learned, injection_record
from observer_rt.engine.reports.news import MeasuredMass, MissingInjection, News, Notice
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.stream.validity import OF_MODEL
from observer_rt.engine.words import TOPICS, Topic, named
from observer_rt.foundation.console import say, visible
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.model.effective import Coefficients

CAPACITY = 10_000  # lines that wait for a slow disk, terminal or reader; more are given up and counted
CLOSING = 1.0  # s for what waits when the service ends
_WARNING = "warning: "
_PRIORITIES = {logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3}  # of syslog, as journald takes them
QUIET_TOPICS = frozenset({Topic.INJECTION, Topic.MEASURED, Topic.STATE})  # which the view shows


class ServiceLog(AbstractContextManager["ServiceLog"]):
    """Log of the service while it runs; a context manager that writes what waits when it ends."""

    def __init__(
        self,
        console: Console,
        file: Path | None = None,
        stream: TextIO | None = None,
        quiet: bool = False,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """file: lines are appended, anew after logrotate; quiet: without what the view shows. Raises `OSError`."""
        self._is_journal = is_journal(console.file, environment)
        self._hidden = QUIET_TOPICS if quiet else frozenset[Topic]()
        self._screen = _Outlet(partial(_show_line, console))
        self._file = self._records = None
        if file is not None:
            write = partial(_append_line, WatchedFileHandler(file, encoding="utf-8"))
            self._file = _Outlet(write, partial(self._tell_loss, f"lines for {file}"))
        if stream is not None:
            self._records = _Outlet(partial(_write_line, stream), partial(self._tell_loss, "records on stdout"))

    def say(self, topic: Topic, text: str, is_over: bool = False) -> None:
        """Logs a line; its level is that of the topic, `is_over`: of something that is well again or normal."""
        level = logging.INFO if is_over else TOPICS[topic].level
        if text.startswith(_WARNING):
            level, text = logging.WARNING, text.removeprefix(_WARNING)
        message = f"{topic}: {one_line(text)}"
        line = f"{_now()} {logging.getLevelName(level)} {message}"
        if topic not in self._hidden:  # the journal has a time of its own, and takes the level from the number
            self._screen.put(f"<{_PRIORITIES[level]}>{message}" if self._is_journal else line)
        if self._file is not None:
            self._file.put(line)

    def record(self, content: Mapping[str, Any]) -> None:
        """Writes a record to the stream, one line of JSON, with the time it was made."""
        if self._records is not None:
            self._records.put(json.dumps({"time": _now(), **content}))

    @property
    def lost(self) -> int:
        """Lines and records given up."""
        return sum(outlet.lost for outlet in self._outlets)

    def __exit__(self, *_: object) -> None:
        for outlet in self._outlets:
            outlet.close()

    @property
    def _outlets(self) -> "list[_Outlet]":
        """Outlets in use, the screen last: it reports the losses of the others."""
        return [*filter(None, (self._records, self._file)), self._screen]

    def _tell_loss(self, what: str, why: str) -> None:
        self.say(Topic.STREAM, f"{what} are lost: {why}")


def is_journal(stream: IO[str], environment: Mapping[str, str]) -> bool:
    """Whether a stream is the one that systemd connected with the journal."""
    try:
        where = os.fstat(stream.fileno())
    except (OSError, ValueError, AttributeError):
        return False
    return environment.get("JOURNAL_STREAM") == f"{where.st_dev}:{where.st_ino}"


def one_line(text: str) -> str:
    """A message of several lines on one, its control characters as escapes."""
    return visible("; ".join(part.strip() for part in text.splitlines()))


def _now() -> str:
    return datetime.now(UTC).astimezone().isoformat(timespec="milliseconds")


def _show_line(console: Console, line: str) -> None:
    if console.is_terminal:
        say(console, line)
    else:  # rich takes half a millisecond a line, in which no injector is attended to
        _write_line(console.file, line)


def _append_line(file: WatchedFileHandler, line: str) -> None:
    file.reopenIfNeeded()
    assert file.stream is not None
    _write_line(file.stream, line)


def _write_line(stream: IO[str], line: str) -> None:
    stream.write(f"{line}\n")
    stream.flush()


class _Outlet:
    """Writes lines in a thread of its own; `on_loss` hears when it begins to lose them."""

    def __init__(self, write: Callable[[str], None], on_loss: Callable[[str], None] = lambda _: None) -> None:
        self.lost = 0
        """Lines given up: nobody took them, or they could not be written."""
        self._write = write
        self._on_loss = on_loss
        self._is_losing = False
        self._waiting: queue.Queue[str | None] = queue.Queue(CAPACITY)
        self._thread = threading.Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    def put(self, line: str) -> None:
        """Have it written, unless too much waits already."""
        try:
            self._waiting.put_nowait(line)
        except queue.Full:
            self._lose("too slow a reader")

    def close(self) -> None:
        """Write what waits, for a moment."""
        with suppress(queue.Full):
            self._waiting.put_nowait(None)
        self._thread.join(CLOSING)

    def _run(self) -> None:
        while (line := self._waiting.get()) is not None:
            try:
                self._write(line)
            except (OSError, ValueError) as error:  # a full disk, a reader that is gone, a stream that was closed
                self._lose(str(error))
            else:
                self._is_losing = False

    def _lose(self, why: str) -> None:
        self.lost += 1
        if not self._is_losing:
            self._is_losing = True
            self._on_loss(why)


class EventLogger:
    """Listener that logs in words."""

    def __init__(self, log: ServiceLog, notifier: Notifier, c: Coefficients, name: str) -> None:
        """c: of the nominal model; name: of the injector, for records; may be empty."""
        self._log = log
        self._named = {"injector": name} if name else {}
        self._notifier = notifier
        self._c = c

    def hear(self, news: News) -> None:
        """Log a report or a notice; states and links go to systemd, too."""
        match news:
            case InjectionReport():
                self._log.say(Topic.INJECTION, injection_line(news) + self._offset(news))
                record = injection_record(news, self._c, has_energizing=news.commanded is not None)
                self._log.record(self._named | record)
            case MeasuredMass():
                self._log.say(Topic.MEASURED, news.as_text())
            case MissingInjection():
                self._log.say(Topic.ENERGIZING, news.as_text())
            case Notice():
                self._log.say(news.topic, news.text, news.is_over)
                if news.topic in (Topic.STATE, Topic.LINK):
                    self._notifier.status(news.text)

    def _offset(self, report: InjectionReport) -> str:
        """Offset of the line-pressure sensor in words, where that is why."""
        if Reason.PRESSURE_OFFSET not in report.reasons or not report.indicators[OFFSET].value:
            return ""
        offset = report.indicators[OFFSET].value * self._c.pressure_scale / MEGAPASCAL
        return f", line pressure reads {offset:+.2f} MPa off"


def injection_line(report: InjectionReport) -> str:
    """Describes an injection on one line."""
    reasons = [*map(named, report.reasons)]
    if Reason.OUTSIDE_LEARNED_RANGE in report.reasons:
        reasons.append(beyond_learned(report))
    verdict = report.validity if report.valid else f"{report.validity}: {'; '.join(reasons)}"
    if report.posterior and OF_MODEL.intersection(report.reasons):
        verdict += f" ({report.posterior_text})"
    mass = "mass unknown" if math.isnan(report.mass) else f"{report.mass / MILLIGRAM:.2f} mg"
    flow, remainder = 100 * report.indicators[NOZZLE].value, report.remainder_text
    return (
        f"injection {report.number} at index {report.start_index}: {mass}, "
        f"rail {report.rail_pressure / MEGAPASCAL:.1f} MPa, nozzle flow {flow:+.1f} %, "
        f"{', '.join((f'correction {report.phi_version}', *in_words(report.surroundings), verdict))}"
        + (f", {remainder}" if remainder else "")
        + (f", {report.commanded.as_text()}" if report.commanded else "")
    )
