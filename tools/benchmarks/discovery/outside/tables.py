"""What is printed of cases outside the vocabulary, and the same as data."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from tools.benchmarks.discovery.outside.answers import Misfit
from tools.benchmarks.discovery.outside.cases import Asked
from tools.benchmarks.discovery.outside.kinds import KINDS, VOCABULARY_KINDS
from tools.benchmarks.discovery.outside.result import (
    OutsideResult,
    Results,
    asked_for,
    figures,
    share,
)
from tools.benchmarks.discovery.real_line.cases import hidden_text
from tools.benchmarks.discovery.result import NAMED, UNKNOWN
from tools.benchmarks.report import NOTHING, ruled

TITLES = {
    Asked.OUTSIDE: "outside the vocabulary",
    Asked.LEFT_OUT: "names taken away",
    Asked.NAMED: "names left",
    Asked.HEALTHY: "healthy",
}


def kind_table(results: Results, asked: Asked) -> Table:
    """Kind by kind of an asking: what was proposed, and how far models are from the plant, medians."""
    table = ruled(TITLES[asked], ("kind",), (
        "in the\nlibrary", "cases", "right\nequation", "\nits own", "\nphase", "proposed", "\naccepted", "as\ngood",
        "p_L off, MPa: before,\nby name, proposed", "halved", "mass off, mg: before,\nby name, proposed", "halved",
        "\nworse", "seconds", "\nadded", "\nof a core",
    ), no_wrap=True)  # fmt: skip
    cases = asked_for(results, asked)
    for name, of_kind in _by_kind(cases).items():
        table.add_row(name, *_row(asked, of_kind))
    table.add_section()
    table.add_row("all", *_row(asked, cases))
    return table


def answer_table(results: Results) -> Table:
    """What was answered; of an unknown effect, which equation is suspected, with a ? where that is wrong."""
    table = ruled("answers", ("asked", "kind"), ())
    table.add_column("answered")
    for asked in TITLES:
        for name, cases in _by_kind(asked_for(results, asked)).items():
            counts = Counter(map(_answer, cases)).most_common()
            table.add_row(asked, name, ", ".join(f"{answer} {count}" for answer, count in counts))
    return table


def _by_kind(cases: Results) -> dict[str, list[OutsideResult]]:
    names = (*KINDS, *VOCABULARY_KINDS, str(Asked.HEALTHY))
    return {name: found for name in names if (found := [r for r in cases if r.case.name == name])}


def case_lines(results: Results) -> list[str]:
    """A line for every case that something is wrong with; sizes in SI."""
    return [_case_line(r) for r in results if _marks(r)]


def json_document(results: Results, tier: str, crashes: Sequence[str]) -> dict[str, Any]:
    """`figures`: those of the bars, null where nothing was measured; `details`: kinds and cases behind them."""
    judged = figures(results, tier)
    return {
        "figures": {"cases": len(results), "tier": tier} | {each.name: each.value for each in judged},
        "details": {
            "kinds": {
                str(asked): {
                    name: _figures(cases) for name, cases in _by_kind(asked_for(results, asked)).items()
                }
                for asked in Asked
            },
            "cases": [asdict(r.case) | asdict(r.answer) | {"wrong": _marks(r)} for r in results],
            "missed": [each.name for each in judged if each.is_met is False],
            "added_core_seconds": [r.answer.added_core_seconds for r in results],
            "crashes": list(crashes),
        },
    }


def _row(asked: Asked, cases: Results) -> list[str]:
    hidden = asked is not Asked.HEALTHY
    library = {r.in_library for r in cases} if asked is Asked.OUTSIDE else set()
    return [
        NOTHING if len(library) != 1 else "yes" if library == {True} else "no",
        str(len(cases)),
        _of([r.right_equation for r in cases]) if hidden else NOTHING,
        _of([r.exact_equation for r in cases]) if hidden else NOTHING,
        _of([r.right_phase for r in cases]) if hidden else NOTHING,
        _of([r.best is not None for r in cases]),
        _of([r.accepted for r in cases]),
        _of([r.as_good for r in cases]) if asked is Asked.LEFT_OUT else NOTHING,
        _gaps(cases, lambda misfit: misfit.pressure_mpa),
        _of([r.pressure_halved for r in cases]),
        _gaps(cases, lambda misfit: misfit.mass_mg),
        _of([r.mass_halved for r in cases]),
        str(sum(r.accepted_worse for r in cases)),
        f"{_median([r.answer.seconds for r in cases]):.1f}",
        f"{_median([r.added_seconds for r in cases]):.1f}",
        f"{_median([r.answer.added_core_seconds for r in cases]):.1f}",
    ]


def _gaps(cases: Results, of: Callable[[Misfit], float]) -> str:
    """Medians of a gap: before, by name, and of what is proposed."""
    proposed = [of(r.best.misfit) for r in cases if r.best is not None]
    columns = [of(r.answer.before) for r in cases], [of(r.answer.named) for r in cases], proposed
    return " ".join(f"{_median(values):6.2f}" if values else f"{NOTHING:>6}" for values in columns)


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan


def _of(flags: Sequence[bool | None]) -> str:
    known = [flag for flag in flags if flag is not None]
    return f"{sum(known)}/{len(known)}" if known else NOTHING


def _answer(r: OutsideResult) -> str:
    """A word or two of an answer; of an unknown effect, which equation is suspected, marked where that is wrong."""
    answer = r.answer
    if answer.verdict == UNKNOWN:
        wrong = "" if r.case.asked is Asked.HEALTHY or r.right_suspicion else "?"
        return f"{UNKNOWN} ({answer.suspect}{wrong})"
    names = "+".join(answer.claims)
    return names if answer.verdict == NAMED else f"{answer.verdict} {names}".strip()


def _marks(r: OutsideResult) -> list[str]:
    """What is wrong with an answer."""
    asked = r.case.asked
    wrong = {
        "wrong name, and sure": r.wrong_and_sure,
        "mass worse": r.accepted_worse,
        "not as good": asked is Asked.LEFT_OUT and not r.as_good,
        "needless": r.best is not None
        and (asked is Asked.HEALTHY or (asked is Asked.NAMED and r.rightly_named)),
    }
    if asked is Asked.OUTSIDE:
        wrong["wrong equation"] = not r.right_equation
        wrong["gap"] = not r.pressure_halved or r.mass_halved is False
    return [mark for mark, holds in wrong.items() if holds]


def _case_line(r: OutsideResult) -> str:
    case, answer, before, after = r.case, r.answer, r.answer.before, r.after
    rig = f" {case.rig.discrepancy}" if case.rig is not None else ""
    terms = "nothing"
    if r.best is not None:
        laws = (f"{t.equation}: {t.coefficient:.3g} {t.law}" for t in r.best.terms)
        terms = " + ".join((*laws, *r.best.effects))
    hidden = hidden_text(((case.name, case.values),) if case.values else ())
    return (
        f"{r.label}{rig}{' with rate' if case.with_rate else ''} {case.asked}: {hidden}: {_answer(r)} "
        f"({answer.confidence:.2f}), proposed {terms}{'' if r.accepted or not r.best else ', refused'}; "
        f"p_L {before.pressure_mpa:.2f} to {after.pressure_mpa:.2f} MPa, mass {before.mass_mg:.2f} to "
        f"{after.mass_mg:.2f} mg; {', '.join(_marks(r)).upper()}"
    )


def _figures(cases: Results) -> dict[str, Any]:
    hidden = cases[0].case.asked is not Asked.HEALTHY
    return {
        "cases": len(cases),
        "right_equation": share([r.right_equation for r in cases]) if hidden else None,
        "own_equation": share([r.exact_equation for r in cases]) if hidden else None,
        "right_phase": share([r.right_phase for r in cases]) if hidden else None,
        "proposed": share([r.best is not None for r in cases]),
        "accepted": share([r.accepted for r in cases]),
        "pressure_halved": share([r.pressure_halved for r in cases]),
        "mass_halved": share([r.mass_halved for r in cases]),
        "wrong_and_sure": share([r.wrong_and_sure for r in cases]),
        "answers": dict(Counter(map(_answer, cases))),
    }
