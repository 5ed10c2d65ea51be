"""The two kinds of failure a user can meet, and the exit codes they become."""

from collections.abc import Mapping


class ObserverError(Exception):
    """A failure with a message for the user; `exit_code` is what the command line returns."""

    exit_code = 1


class RunError(ObserverError):
    """Failed at run time: the interface went away, the disk is full (exit code 1)."""


class UserError(ObserverError):
    """The command line or a file the user supplied must change (exit code 2).

    The message names the place (file, key or line), what was found, what was expected and how to mend it.
    """

    exit_code = 2

    def __init__(self, place: str, problem: str, remedy: str = "") -> None:
        self.place = place
        self.problem = problem
        self.remedy = remedy
        super().__init__(f"{place}: {problem}" + (f"\n  remedy: {remedy}" if remedy else ""))


class CombinedError(ObserverError):
    """What failed of several that were served side by side, each under its name.

    The exit code is that of one alone, and 1 where some failed at run time: another start may help those.
    """

    def __init__(self, failures: Mapping[str, ObserverError]) -> None:
        self.exit_code = min(failure.exit_code for failure in failures.values())
        super().__init__("\n".join(f"{name}: {failure}" for name, failure in failures.items()))
