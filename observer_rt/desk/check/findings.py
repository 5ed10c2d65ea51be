"""Findings of a check, for the screen and for programs."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import wraps
from typing import Any, ParamSpec

from rich.table import Table
from rich.text import Text

from observer_rt.foundation.console import visible
from observer_rt.foundation.errors import UserError

SCHEMA = 1
P = ParamSpec("P")
WITHOUT_LIFT = (
    "needle_lift: not measured, learned by the energizing; rates are PRELIMINARY while it moves, its "
    "delays and speeds are told; fit finds them, discover needs a lift"
)
_WIDEST = 100  # characters: to be read, and passed on


class Level(StrEnum):
    OK = "ok"
    WARNING = "warning"
    ERROR = "error"


_STYLES = {Level.OK: "green", Level.WARNING: "yellow", Level.ERROR: "bold red"}


@dataclass(frozen=True)
class Finding:
    """Result of one check: its topic, its level, and a text with the remedy where there is one."""

    topic: str
    level: Level
    text: str
    error: UserError | None = field(default=None, compare=False)
    """Error for a command that does not go on with this finding."""


Statement = str | UserError | Finding
"""Result of a rule: a text where all is well, an error at a key of the bench file, or a finding."""


def ruled(topic: str) -> Callable[[Callable[P, Iterator[Statement]]], Callable[P, list[Finding]]]:
    """Decorate a generator of statements to return findings of this topic; an error that it raises is the last."""

    def decorate(rules: Callable[P, Iterator[Statement]]) -> Callable[P, list[Finding]]:
        @wraps(rules)
        def walk(*arguments: P.args, **options: P.kwargs) -> list[Finding]:
            findings = []
            try:
                for statement in rules(*arguments, **options):
                    findings.append(_finding(topic, statement))
            except UserError as error:
                findings.append(failed(topic, error))
            return findings

        return walk

    return decorate


def _finding(topic: str, statement: Statement) -> Finding:
    match statement:
        case str():
            return Finding(topic, Level.OK, statement)
        case UserError():  # the file is known, so that the text begins with the key
            return failed(topic, statement, statement.location.rpartition(": ")[2])
    return statement if statement.topic else replace(statement, topic=topic)


def warning(text: str, remedy: str = "", topic: str = "") -> Finding:
    """A warning; topic: by default the topic of the rule."""
    return Finding(topic, Level.WARNING, f"{text}; {remedy}" if remedy else text)


def graded(is_good: bool, text: str, remedy: str = "", topic: str = "") -> Finding:
    """An OK finding, or else a warning with its remedy; topic: by default the topic of the rule."""
    return Finding(topic, Level.OK, text) if is_good else warning(text, remedy, topic)


def failed(topic: str, error: UserError, location: str = "") -> Finding:
    """The finding that a file of the user must change; location: named instead of the error's location."""
    problem = f"{error.problem}; {error.remedy}" if error.remedy else error.problem
    return Finding(topic, Level.ERROR, f"{location or error.location}: {problem}", error)


def as_table(findings: Sequence[Finding]) -> Table:
    table = Table("topic", "", box=None, pad_edge=False)
    table.add_column("finding", max_width=_WIDEST)
    topic = ""
    for finding in findings:
        shown = "" if finding.topic == topic else finding.topic
        topic = finding.topic
        table.add_row(shown, Text(finding.level, _STYLES[finding.level]), Text(visible(finding.text)))
    return table


def as_json_document(findings: Sequence[Finding]) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "warnings": sum(finding.level is Level.WARNING for finding in findings),
        "errors": sum(finding.level is Level.ERROR for finding in findings),
        "findings": [{"topic": f.topic, "level": str(f.level), "text": f.text} for f in findings],
    }
