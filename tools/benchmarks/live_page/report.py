"""What was found of the live page as a table and as a document."""

from dataclasses import asdict
from typing import Any

from rich.table import Table

from tools.benchmarks.live_page.measure import LONGEST, PER_SECOND, LivePage
from tools.benchmarks.live_page.watched import Gaps, Watched


def page_document(found: LivePage) -> dict[str, Any]:
    """`figures` by name, `details` of what was measured."""
    return {
        "figures": {
            "longest_gap_ms": found.drawn.longest,
            "longest_gap_bar_ms": LONGEST,
            "is_met": found.is_met,
            "p99_gap_ms": found.drawn.p99,
            "median_gap_ms": found.drawn.median,
            "bare_longest_gap_ms": found.bare_drawn.longest,
            "injections_seen_share": found.seen_share,
            "lost_frames": found.lost_frames,
            "server_cpu": found.ours.server_cpu,
            "browser_cpu": found.ours.browser_cpu,
        },
        "details": asdict(found),
    }


def page_table(found: LivePage) -> Table:
    """Both pages; gaps are longest / 99 % / median."""
    verdict = "met" if found.is_met else "MISSED"
    title = (
        f"live page, {found.injectors} x {PER_SECOND} injections a second, {found.ours.seconds:.0f} s, load before "
        f"{found.load:.1f}\nlongest gap {found.drawn.longest:.0f} ms, bar {LONGEST:.0f}: {verdict}; "
        f"{100.0 * found.seen_share:.0f} % of the injections seen, {found.lost_frames} frames lost"
    )
    columns = ("", "frames a second", "gaps, ms: longest / 99 % / median", "server CPU", "browser CPU")
    table = Table(*columns, title=title, title_justify="left")
    for name, watched in (("observer_rt monitor", found.ours), ("Bokeh, one line", found.bare)):
        _add(table, f"{name}: made at all", watched.made, watched)
        for panel, gaps in watched.drawn.items():
            _add(table, f"  {panel} drawn anew", gaps)
        table.add_section()
    return table


def _add(table: Table, name: str, gaps: Gaps, watched: Watched | None = None) -> None:
    shares = (f"{watched.server_cpu:.2f}", f"{watched.browser_cpu:.2f}") if watched else ("", "")
    table.add_row(name, f"{gaps.per_second:.1f}", str(gaps), *shares)
