"""Lines of the service: to stderr, a file and, injections as JSON, stdout. None of them ever holds up the loop."""

import json
import logging
import os
import queue
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from logging.handlers import WatchedFileHandler
from pathlib import Path
from typing import IO, Any, Self, TextIO

from rich.console import Console

from observer_rt.engine.words import TOPICS, Topic
from observer_rt.foundation.console import say

CAPACITY = 10_000  # lines that wait for a slow disk, terminal or reader; more are given up and counted
CLOSING = 1.0  # s for what waits when the service ends
_WARNING = "warning: "
_PRIORITIES = {logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3}  # of syslog, as journald takes them
QUIET_TOPICS = frozenset({Topic.INJECTION, Topic.MEASURED, Topic.STATE})  # which the view shows


class ServiceLog:
    """Log of the service while it runs; a context manager that writes what waits when it ends."""

    def __init__(
        self,
        console: Console,
        file: Path | None = None,
        stream: TextIO | None = None,
        quiet: bool = False,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """console: of stderr; file: to which lines are appended, anew after logrotate moved it; stream: of records.

        quiet: leave to the view what it shows. Raises `OSError` when the file cannot be opened.
        """
        shown = _Shown(console)
        shown.setFormatter(_Line(is_journal(console.file, environment)))
        if quiet:
            shown.addFilter(lambda record: record.__dict__["topic"] not in QUIET_TOPICS)
        screen = _Outlet(shown)
        self._outlets = [screen]
        if file is not None:
            written = WatchedFileHandler(file, encoding="utf-8")
            written.setFormatter(_Line())
            self._outlets.append(_Outlet(written, partial(_tell_loss, screen, f"lines for {file}")))
        self._records: _Outlet | None = None
        if stream is not None:
            records = logging.StreamHandler(stream)
            self._records = _Outlet(records, partial(_tell_loss, screen, "records on stdout"))

    def say(self, topic: Topic, text: str, is_over: bool = False) -> None:
        """Logs a line; its level is that of the topic, `is_over`: of something that is well again or normal."""
        level = logging.INFO if is_over else TOPICS[topic].level
        if text.startswith(_WARNING):
            level, text = logging.WARNING, text.removeprefix(_WARNING)
        record = _made(topic, level, text)
        for outlet in self._outlets:
            outlet.put(record)

    def record(self, content: Mapping[str, Any]) -> None:
        """Writes a record to the stream, one line of JSON, with the time it was made."""
        if self._records is not None:
            line = json.dumps(
                {"time": datetime.now(UTC).astimezone().isoformat(timespec="milliseconds"), **content}
            )
            self._records.put(logging.makeLogRecord({"msg": line}))

    @property
    def lost(self) -> int:
        """Lines and records given up."""
        return sum(outlet.lost for outlet in (*self._outlets, self._records) if outlet is not None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for outlet in (self._records, *reversed(self._outlets)):  # the screen last: it reports the others
            if outlet is not None:
                outlet.close()


def is_journal(stream: IO[str], environment: Mapping[str, str]) -> bool:
    """Whether a stream is the one that systemd connected with the journal."""
    try:
        where = os.fstat(stream.fileno())
    except (OSError, ValueError, AttributeError):
        return False
    return environment.get("JOURNAL_STREAM") == f"{where.st_dev}:{where.st_ino}"


def one_line(text: str) -> str:
    """A message of several lines on one."""
    return "; ".join(part.strip() for part in text.splitlines())


def _made(topic: Topic, level: int, text: str) -> logging.LogRecord:
    return logging.makeLogRecord(
        {"levelno": level, "levelname": logging.getLevelName(level), "msg": text, "topic": topic}
    )


def _tell_loss(screen: "_Outlet", what: str, why: str) -> None:
    screen.put(_made(Topic.STREAM, TOPICS[Topic.STREAM].level, f"{what} are lost: {why}"))


class _Line(logging.Formatter):
    """`2026-03-01T12:00:00.000+01:00 WARNING input: text`.

    Of the journal `<4>input: text`: it has a time of its own, and takes the level from the number.
    """

    def __init__(self, of_journal: bool = False) -> None:
        super().__init__()
        self._of_journal = of_journal

    def format(self, record: logging.LogRecord) -> str:
        made = datetime.fromtimestamp(record.created, UTC).astimezone().isoformat(timespec="milliseconds")
        level = f"<{_PRIORITIES[record.levelno]}>" if self._of_journal else f"{made} {record.levelname} "
        return f"{level}{record.__dict__['topic']}: {one_line(record.getMessage())}"


class _Shown(logging.Handler):
    """Handler that prints onto the console, above the view where there is one."""

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        try:
            if self._console.is_terminal:
                say(self._console, self.format(record))
            else:  # rich takes half a millisecond a line, in which no injector is attended to
                self._console.file.write(f"{self.format(record)}\n")
                self._console.file.flush()
        except OSError:
            self.handleError(record)


class _Outlet:
    """Hands records to a handler in a thread of its own; `on_loss` hears when it begins to lose them."""

    def __init__(self, handler: logging.Handler, on_loss: Callable[[str], None] = lambda _: None) -> None:
        self.lost = 0
        """Records given up: nobody took them, or they could not be written."""
        self._handler = handler
        self._on_loss = on_loss
        self._is_losing = False
        self._waiting: queue.Queue[logging.LogRecord | None] = queue.Queue(CAPACITY)
        handler.handleError = lambda _: self._lose(str(sys.exc_info()[1]))  # type: ignore[method-assign,assignment]
        self._thread = threading.Thread(target=self._write, name="log", daemon=True)
        self._thread.start()

    def put(self, record: logging.LogRecord) -> None:
        """Have it written, unless too much waits already."""
        try:
            self._waiting.put_nowait(record)
        except queue.Full:
            self._lose("too slow a reader")

    def close(self) -> None:
        """Write what waits, for a moment."""
        with suppress(queue.Full):
            self._waiting.put_nowait(None)
        self._thread.join(CLOSING)
        if not self._thread.is_alive():
            with suppress(OSError):
                self._handler.close()

    def _write(self) -> None:
        while (record := self._waiting.get()) is not None:
            lost = self.lost
            self._handler.handle(record)
            self._is_losing = self._is_losing and self.lost > lost

    def _lose(self, why: str) -> None:
        self.lost += 1
        if not self._is_losing:
            self._is_losing = True
            self._on_loss(why)
