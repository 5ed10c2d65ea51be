"""What the service tells while it runs, and who hears it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from observer_rt.service.core.injection_report import InjectionReport
from observer_rt.service.inputs.energizing import Mismatch
from observer_rt.service.inputs.measured_mass import MeasuredMass


@dataclass(frozen=True)
class LinkNews:
    """Something went wrong on a link of a daemon, or is well again."""

    text: str

    def as_text(self) -> str:
        """One line and, where there is one, a remedy."""
        return self.text


News = InjectionReport | MeasuredMass | Mismatch | LinkNews
"""A judged injection, whose samples are still remembered; its measured mass; one missing or without a command."""
Listener = Callable[[News], None]
"""Is called from the loop, with all news."""


def to_all(listeners: Sequence[Listener]) -> Listener:
    """Hands on to several, in order."""

    def tell(news: News) -> None:
        for listener in listeners:
            listener(news)

    return tell


class Notes:
    """A listener that keeps all it hears."""

    def __init__(self) -> None:
        self.injections: list[InjectionReport] = []
        self.measured: list[MeasuredMass] = []
        self.mismatches: list[Mismatch] = []
        self.messages: list[str] = []

    def __call__(self, news: News) -> None:
        """Keep it."""
        match news:
            case InjectionReport():
                self.injections.append(news)
            case MeasuredMass():
                self.measured.append(news)
            case Mismatch():
                self.mismatches.append(news)
            case LinkNews(text):
                self.messages.append(text)
