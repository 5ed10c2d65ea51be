"""Findings of a check, for the screen and for programs."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
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
    "needle_lift: not measured, learned by the energizing; rates are PRELIMINARY until the needle is shut, its "
    "delays and speeds are told; fit finds them, discover needs a lift"
)
_WIDEST = 100  # characters: to be read, and passed on


class Level(StrEnum):
    """Severity of a finding."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"


_STYLES = {Level.OK: "green", Level.WARNING: "yellow", Level.ERROR: "bold red"}


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    topic: str
    level: Level
    text: str
    error: UserError | None = field(default=None, compare=False)
    """Error for a command that does not go on with this finding."""


Said = str | tuple[bool, str, str] | UserError | Finding
"""Result of a rule: all is well; whether it is, with a text and a remedy; an error; or a finding as it is."""


def ruled(topic: str) -> Callable[[Callable[P, Iterator[Said]]], Callable[P, list[Finding]]]:
    """Walk through the rules of a topic: what they say becomes findings, an error they raise the last one."""

    def decorate(rules: Callable[P, Iterator[Said]]) -> Callable[P, list[Finding]]:
        @wraps(rules)
        def walk(*arguments: P.args, **options: P.kwargs) -> list[Finding]:
            findings = []
            try:
                for said in rules(*arguments, **options):
                    findings.append(_finding(topic, said))
            except UserError as error:
                findings.append(failed(topic, error))
            return findings

        return walk

    return decorate


def _finding(topic: str, said: Said) -> Finding:
    match said:
        case Finding():
            return said
        case str():
            return Finding(topic, Level.OK, said)
        case UserError():  # of the bench file, which is known: its text says the key
            return Finding(topic, Level.ERROR, f"{said.location.rpartition(': ')[2]}: {_said(said)}", said)
        case is_good, text, remedy:
            return graded(topic, is_good, text, remedy)


def graded(topic: str, is_good: bool, text: str, remedy: str = "") -> Finding:
    """A finding that is OK, or else a warning with its remedy."""
    if is_good:
        return Finding(topic, Level.OK, text)
    return Finding(topic, Level.WARNING, f"{text}; {remedy}" if remedy else text)


def failed(topic: str, error: UserError) -> Finding:
    """The finding that a file of the user must change."""
    return Finding(topic, Level.ERROR, f"{error.location}: {_said(error)}", error)


def _said(error: UserError) -> str:
    return f"{error.problem}; {error.remedy}" if error.remedy else error.problem


def as_table(findings: Sequence[Finding]) -> Table:
    """Findings as a table for the terminal."""
    table = Table("topic", "", box=None, pad_edge=False)
    table.add_column("finding", max_width=_WIDEST)
    topic = ""
    for finding in findings:
        shown = "" if finding.topic == topic else finding.topic
        topic = finding.topic
        table.add_row(shown, Text(finding.level, _STYLES[finding.level]), Text(visible(finding.text)))
    return table


def as_json_document(findings: Sequence[Finding]) -> dict[str, Any]:
    """Findings as a document for `json.dumps`."""
    return {
        "schema": SCHEMA,
        "warnings": sum(finding.level is Level.WARNING for finding in findings),
        "errors": sum(finding.level is Level.ERROR for finding in findings),
        "findings": [
            {"topic": finding.topic, "level": str(finding.level), "text": finding.text} for finding in findings
        ],
    }
