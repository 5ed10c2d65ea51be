"""What is printed of the scores, and the same as data."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from tools.benchmarks.bars import by_class, coverage, halfwidths, violations, x3_ratios
from tools.benchmarks.cases import CLASSES, Group
from tools.benchmarks.score import NOMINAL, OBSERVER, CaseScore

_WEAR_ONLY = _NOT_RUN = "-"


def class_table(scores: Sequence[CaseScore]) -> Table:
    """Our observer, class by class."""
    table = Table(title="observer, events 11-20", title_justify="left")
    table.add_column("class", no_wrap=True)
    for heading in (
        "cases", "mass error %\nmedian", "\np95", "\nmax", "RMSE mm3/ms\nmedian", "\np95", "\nmax",
        "valid\n%", "wrong\nvalid", "x3 ratio\np5", "coverage\n%", "training ms\nmedian", "\np99",
        "nominal\nmass % median",
    ):  # fmt: skip
        table.add_column(heading, justify="right")
    for name, cases in by_class(scores).items():
        table.add_row(name, *_row(cases))
    return table


def peer_tables(scores: Sequence[CaseScore]) -> tuple[Table, Table]:
    """Every estimator, class by class, median and largest of mass error and of RMSE; and the information limit."""
    names = list(dict.fromkeys(e.name for s in scores for e in s.estimators))
    mass = Table(title="mass error %, events 11-20, median / max", title_justify="left")
    rate = Table(title="RMSE mm3/ms, events 11-20, median / max", title_justify="left")
    for table in (mass, rate):
        table.add_column("class", no_wrap=True)
        for name in names:
            table.add_column(name, justify="right", no_wrap=True)
    mass.add_column("limit %\n1 sigma", justify="right")
    mass.add_column("half-width\nvs limit", justify="right")
    for class_name, cases in by_class(scores).items():
        with_peers = [s for s in cases if s.limits_mg]
        if with_peers:
            limits = [s.limit_pct for s in with_peers if s.limit_pct is not None]
            widths = halfwidths(with_peers)
            mass.add_row(
                class_name,
                *_cells(names, with_peers, lambda s, name: abs(s.mass_error_pct(name))),
                f"{np.median(limits):.3f}",
                f"{np.median(widths):.2f}" if widths else "",
            )
            rate.add_row(class_name, *_cells(names, with_peers, lambda s, name: s.rate_rmse(name)))
    return mass, rate


def _cells(
    names: Sequence[str], cases: Sequence[CaseScore], figure: Callable[[CaseScore, str], float]
) -> list[str]:
    """Median and largest of a figure for every estimator, over the cases it ran on."""
    cells = []
    for name in names:
        values = [figure(s, name) for s in cases if s.has(name)]
        cells.append(f"{np.median(values):.2f} / {max(values):.2f}" if values else _NOT_RUN)
    return cells


def _row(cases: Sequence[CaseScore]) -> list[str]:
    mass = [abs(s.mass_error_pct()) for s in cases]
    rmse = [s.rate_rmse() for s in cases]
    training = [ms for s in cases for ms in s.training_ms]
    ratios = x3_ratios(cases)
    covered = coverage(cases)
    return [
        str(len(cases)),
        *(f"{value:.3f}" for value in _spread(mass)),
        *(f"{value:.3f}" for value in _spread(rmse)),
        f"{100.0 * np.mean([s.valid_share for s in cases]):.1f}",
        str(sum(s.wrong_valid for s in cases)),
        f"{np.percentile(ratios, 5):.0f}" if ratios else _WEAR_ONLY,
        f"{100.0 * np.mean(covered):.0f}" if covered else "",
        f"{np.median(training):.1f}" if training else "",
        f"{np.percentile(training, 99):.1f}" if training else "",
        f"{np.median([abs(s.mass_error_pct(NOMINAL)) for s in cases]):.3f}",
    ]


def json_document(scores: Sequence[CaseScore], crashes: Sequence[str]) -> dict[str, Any]:
    """`figures` over the classes that must be estimated well, `details` per class."""
    main = [s for s in scores if CLASSES[s.class_name].group is Group.MAIN]
    ratios = x3_ratios(scores)
    covered = coverage(main)
    widths = halfwidths(main)
    shares = [np.mean([s.valid_share for s in cases]) for cases in by_class(main).values()]
    return {
        "figures": {
            "mass_error_max_pct": max((abs(s.mass_error_pct()) for s in main), default=None),
            "rate_rmse_max_mm3_per_ms": max((s.rate_rmse() for s in main), default=None),
            "x3_mse_ratio_min": min(ratios, default=None),
            "coverage_95_share": float(np.mean(covered)) if covered else None,
            "wrong_valid": sum(s.wrong_valid for s in scores),
            "valid_share_min": float(min(shares)) if shares else None,
            "interval_halfwidth_vs_limit_median": float(np.median(widths)) if widths else None,
        },
        "details": {
            "classes": {name: _class_details(cases) for name, cases in by_class(scores).items()},
            "violations": violations(scores),
            "crashes": list(crashes),
        },
    }


def _class_details(cases: Sequence[CaseScore]) -> dict[str, Any]:
    training = [ms for s in cases for ms in s.training_ms]
    return {
        "cases": len(cases),
        "mass_error_pct": _named_spread([abs(s.mass_error_pct()) for s in cases]),
        "rate_rmse_mm3_per_ms": _named_spread([s.rate_rmse() for s in cases]),
        "valid_share": float(np.mean([s.valid_share for s in cases])),
        "wrong_valid": sum(s.wrong_valid for s in cases),
        "peers": {
            e.name: {
                "mass_error_pct": _named_spread([abs(s.mass_error_pct(e.name)) for s in cases]),
                "rate_rmse_mm3_per_ms": _named_spread([s.rate_rmse(e.name) for s in cases]),
            }
            for e in cases[0].estimators
            if e.name != OBSERVER and all(s.has(e.name) for s in cases)
        },
        "training_ms_median": float(np.median(training)) if training else None,
        "worst": [s.number for s in sorted(cases, key=lambda s: -abs(s.mass_error_pct()))[:3]],
    }


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    return float(np.median(values)), float(np.percentile(values, 95)), max(values)


def _named_spread(values: Sequence[float]) -> dict[str, float]:
    return dict(zip(("median", "p95", "max"), _spread(values), strict=True))
