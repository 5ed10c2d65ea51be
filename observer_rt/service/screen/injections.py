"""The recent injections as a table."""

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from observer_rt.estimation.scalars import NOZZLE
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.reports.injection_record import NAMED
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.screen.shown import ShownInjection
from observer_rt.service.words import REASONS

WITH_WORDS = 110  # columns, from which all columns have room, and reasons are put into words
HEADING = 2  # lines
_FIRST = [NAMED[name] for name in ("number", "rail_pressure_MPa", "mass_mg", "mass_ci95_mg")]
_COMMAND = [NAMED["command"], NAMED["opening_delay_us"]]


def injections(shown: Sequence[ShownInjection], width: int, c: Coefficients) -> Table:
    """A row for each, the last one at the bottom; in 76 columns no figure is cut. c: of the nominal model."""
    is_measured = any(item.measured for item in shown)
    is_commanded = any(item.report.commanded for item in shown)
    is_tight = width < WITH_WORDS and (is_measured or is_commanded)
    compared = () if is_tight else shown[-1].references or ()
    table = Table(box=None, padding=(0, 1 if is_tight else 2, 0, 0), pad_edge=False)
    names = [f"{reference.name}\nmg" for reference in compared]
    if is_measured:
        names += ["measured\nmg", "error\n%"]
    commanded = _COMMAND if is_commanded else []
    headings = [*(each.heading for each in _FIRST), *names, *(each.heading for each in commanded)]
    for heading in (*headings, "v_H\n-"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column(Text("\nvalid?"), no_wrap=True)
    for item in shown:
        report = item.report
        references = [f"{reference.mass / MILLIGRAM:.2f}" for reference in item.references or ()]
        references = (references + ["-"] * len(compared))[: len(compared)]
        table.add_row(
            *(each.text(each.of(report, c)) for each in _FIRST),
            *references,
            *(_measured(item) if is_measured else ()),
            *(each.text(each.of(report, c)) for each in commanded),
            _wear(report, not is_tight),
            _verdict(report, width >= WITH_WORDS),
        )
    return table


def last_injection(item: ShownInjection, c: Coefficients) -> tuple[Text, ...]:
    """Number, mass [mg], its interval, wear of the nozzle and verdict: cells of a row."""
    report = item.report
    verdict = Text("yes", "green") if report.valid else Text(_names(report), "yellow")
    number, _, *mass = (each.text(each.of(report, c)) for each in _FIRST)
    return (*map(Text, (number, *mass, _wear(report, True))), verdict)


def _wear(report: InjectionReport, with_interval: bool) -> str:
    wear = report.indicators[NOZZLE]
    sigma = f" ±{1.96 * wear.sigma:.3f}" if with_interval and wear.sigma is not None else ""
    return f"{wear.value:+.3f}{sigma}"


def _verdict(report: InjectionReport, in_words: bool) -> Text:
    if report.valid:
        return Text("valid", style="green")
    words = f": {REASONS[report.reason].what}" if in_words else ""
    return Text(_names(report) + words, style="yellow", overflow="ellipsis")


def _names(report: InjectionReport) -> str:
    return ", ".join(reason.name for reason in report.reasons)


def _measured(shown: ShownInjection) -> tuple[str, str]:
    """Measured mass, and the error of the estimate."""
    if shown.measured is None:
        return "-", "-"
    return f"{shown.measured.mass / MILLIGRAM:.2f}", f"{100 * shown.measured.error:+.2f}"
