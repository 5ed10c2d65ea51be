"""A campaign in figures."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from tools.benchmarks.kills.campaign import Kill, Plan, Strike


def kills_table(kills: Sequence[Kill], plan: Plan) -> Table:
    """A row for each way of being killed."""
    table = Table(
        *("killed", "kills", "injections told", "warnings", "oldest loss: state s", "journal s", "problems"),
        title=f"{len(kills)} kills, saved within {plan.within:g} s, or as long as the disk was full",
    )
    for strike in Strike:
        of_it = [kill for kill in kills if kill.strike is strike]
        if of_it:
            table.add_row(
                strike.value,
                str(len(of_it)),
                str(sum(kill.told for kill in of_it)),
                str(sum(kill.warnings for kill in of_it)),
                f"{max(kill.loss.state for kill in of_it):.3f}",
                f"{max(kill.loss.journal for kill in of_it):.3f}",
                str(sum(len(kill.problems) for kill in of_it)),
            )
    return table


def kills_document(kills: Sequence[Kill], plan: Plan) -> dict[str, Any]:
    """The same for programs, kill by kill."""
    return {
        "within_s": plan.within,
        "seed": plan.seed,
        "interface": plan.interface,
        "kills": [asdict(kill) for kill in kills],
    }
