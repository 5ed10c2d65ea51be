"""Regular expressions by which a command finds injectors and dates in the paths of recordings."""

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple, Self

from observer_rt.foundation.errors import UserError

INJECTOR_FROM, TIME_FROM = "--injector-from", "--time-from"
_DATE_FORMATS = {8: "%Y%m%d", 12: "%Y%m%d%H%M", 14: "%Y%m%d%H%M%S"}  # by the number of digits


class PathPattern(NamedTuple):
    """A regular expression that an option of the command line gives, for paths."""

    option: str
    expression: re.Pattern[str]

    @classmethod
    def read(cls, option: str, text: str) -> Self:
        """Raises `UserError` for a text that is no regular expression."""
        try:
            return cls(option, re.compile(text))
        except re.error as error:
            raise UserError(f"{option} {text}", f"is no regular expression: {error}", "correct it") from error

    def text_in(self, path: Path) -> str:
        """The pattern's first group in a path, or its whole match. Raises `UserError` for a path without a match."""
        match = self.expression.search(str(path))
        text = match and match[min(1, self.expression.groups)]
        if not text:
            raise UserError(str(path), f"'{self.expression.pattern}' is not in its path", f"see {self.option}")
        return text

    def date_in(self, path: Path) -> datetime:
        """Date in a path, with the time of day (UTC) if it is there. Raises `UserError` for a path without a date."""
        digits = re.sub(r"\D", "", self.text_in(path))
        try:
            return datetime.strptime(digits, _DATE_FORMATS[len(digits)]).replace(tzinfo=UTC)
        except (KeyError, ValueError):
            remedy = f"see {self.option}: year, month, day and, if it is there, the time of day"
            raise UserError(str(path), f"'{self.expression.pattern}' finds no date in its path", remedy) from None
