"""What is printed of the scores, and the same as data."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from tools.benchmarks.bars import by_class, coverage, halfwidths, violations, x3_ratios
from tools.benchmarks.cases import CLASSES, Group
from tools.benchmarks.score import NOMINAL, OBSERVER, CaseScore

_WEAR_ONLY = "-"


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


def peer_table(scores: Sequence[CaseScore]) -> Table:
    """Every estimator, class by class: mass error and RMSE, median and largest; and the information limit."""
    table = Table(title="peers: mass error % median / max, RMSE mm3/ms median / max", title_justify="left")
    names = list(dict.fromkeys(e.name for s in scores for e in s.estimators))
    table.add_column("class", no_wrap=True)
    for name in names:
        table.add_column(f"{name}\nmass", justify="right", no_wrap=True)
        table.add_column("\nRMSE", justify="right", no_wrap=True)
    table.add_column("limit %\n1 sigma", justify="right")
    table.add_column("half-width\nvs limit", justify="right")
    for class_name, cases in by_class(scores).items():
        with_peers = [s for s in cases if s.limits_mg]
        if with_peers:
            table.add_row(class_name, *_peer_row(names, with_peers))
    return table


def _peer_row(names: Sequence[str], cases: Sequence[CaseScore]) -> list[str]:
    cells = []
    for name in names:
        mass, rmse = [abs(s.mass_error_pct(name)) for s in cases], [s.rate_rmse(name) for s in cases]
        cells += [f"{np.median(values):.2f} / {max(values):.2f}" for values in (mass, rmse)]
    limits = [s.limit_pct for s in cases if s.limit_pct is not None]
    widths = halfwidths(cases)
    return [*cells, f"{np.median(limits):.3f}", f"{np.median(widths):.2f}" if widths else ""]


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
            if e.name != OBSERVER
        },
        "training_ms_median": float(np.median(training)) if training else None,
        "worst": [s.number for s in sorted(cases, key=lambda s: -abs(s.mass_error_pct()))[:3]],
    }


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    return float(np.median(values)), float(np.percentile(values, 95)), max(values)


def _named_spread(values: Sequence[float]) -> dict[str, float]:
    return dict(zip(("median", "p95", "max"), _spread(values), strict=True))
