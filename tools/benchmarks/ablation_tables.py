"""What is printed of an ablation, and the same as data."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from tools.benchmarks.ablation import VARIANTS, AblationScore, VariantScore
from tools.benchmarks.command_line import ruled

_NOT_JUDGED = "-"


def ablation_tables(scores: Sequence[AblationScore]) -> tuple[Table, Table]:
    """Every variant over all cases, and class by class."""
    classes = list(dict.fromkeys(score.class_name for score in scores))
    overall = ruled(f"one part changed: {len(scores)} cases, events 11-20", ("observer",), (
        "mass error %\nmedian", "\np95", "\nmax", "RMSE mm3/ms\np95", "valid\n%", "wrong\nvalid",
        "training ms\nmedian",
    ))  # fmt: skip
    headings = [name.replace("_", "\n") for name in classes]
    by_class = ruled("mass error %, events 11-20, 95 % of the cases of a class", ("observer",), headings)
    for variant in VARIANTS:
        overall.add_row(variant, *_row(_of(variant, scores)))
        by_class.add_row(
            variant,
            *(f"{_p95_mass(_of(variant, [s for s in scores if s.class_name == c])):.3f}" for c in classes),
        )
    return overall, by_class


def ablation_document(scores: Sequence[AblationScore], crashes: Sequence[str]) -> dict[str, Any]:
    """`figures` over all cases, `details` per variant and class."""
    classes = list(dict.fromkeys(score.class_name for score in scores))
    return {
        "figures": {"mass_error_p95_pct": {name: _p95_mass(_of(name, scores)) for name in VARIANTS}},
        "details": {
            "classes": {
                c: {name: _details(_of(name, [s for s in scores if s.class_name == c])) for name in VARIANTS}
                for c in classes
            },
            "crashes": list(crashes),
        },
    }


def _of(variant: str, scores: Sequence[AblationScore]) -> list[VariantScore]:
    return [v for score in scores for v in score.variants if v.name == variant]


def _row(found: Sequence[VariantScore]) -> list[str]:
    masses = [abs(v.mass_error_pct) for v in found]
    shares = [v.valid_share for v in found if v.valid_share is not None]
    return [
        f"{np.median(masses):.3f}",
        f"{np.percentile(masses, 95):.3f}",
        f"{max(masses):.3f}",
        f"{np.percentile([v.rate_rmse for v in found], 95):.3f}",
        f"{100.0 * np.mean(shares):.1f}" if shares else _NOT_JUDGED,
        str(sum(v.wrong_valid for v in found if v.wrong_valid is not None)) if shares else _NOT_JUDGED,
        f"{np.median([ms for v in found for ms in v.training_ms]):.1f}",
    ]


def _p95_mass(found: Sequence[VariantScore]) -> float:
    return float(np.percentile([abs(v.mass_error_pct) for v in found], 95))


def _details(found: Sequence[VariantScore]) -> dict[str, Any]:
    masses = [abs(v.mass_error_pct) for v in found]
    shares = [v.valid_share for v in found if v.valid_share is not None]
    return {
        "mass_error_pct": {"median": float(np.median(masses)), "p95": _p95_mass(found), "max": max(masses)},
        "rate_rmse_p95_mm3_per_ms": float(np.percentile([v.rate_rmse for v in found], 95)),
        "valid_share": float(np.mean(shares)) if shares else None,
        "wrong_valid": sum(v.wrong_valid or 0 for v in found) if shares else None,
        "training_ms_median": float(np.median([ms for v in found for ms in v.training_ms])),
    }
