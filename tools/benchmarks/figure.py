"""A figure that is measured, beside the bar it is judged by."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table

_NOT_MEASURED = "-"


@dataclass(frozen=True)
class Figure:
    """A figure under the name it has in the JSON document. at_least or at_most: its bar, None where there is none."""

    name: str
    value: float | None
    peer: str
    at_most: float | None = None
    at_least: float | None = None

    @property
    def is_met(self) -> bool | None:
        """Whether it meets its bar; None without one, or where nothing was measured."""
        if self.value is None or (self.at_most is None and self.at_least is None):
            return None
        low = self.at_least is None or self.value >= self.at_least
        return low and (self.at_most is None or self.value <= self.at_most)

    @property
    def bar(self) -> str:
        """The bar as text."""
        if self.at_most is not None:
            return f"<= {self.at_most:g}"
        return f">= {self.at_least:g}" if self.at_least is not None else ""


def figures_table(figures: Sequence[Figure], title: str, load: tuple[float, float] | None = None) -> Table:
    """Figures with their verdicts; load: of the machine, before and after."""
    if load is not None:
        title += f" (load {load[0]:.1f} before, {load[1]:.1f} after)"
    table = Table("figure", "value", "bar", "", "against", title=title, title_justify="left")
    for each in figures:
        value = _NOT_MEASURED if each.value is None else f"{each.value:.4g}"
        verdict = {None: "", True: "met", False: "MISSED"}[each.is_met]
        table.add_row(each.name, value, each.bar, verdict, each.peer)
    return table
