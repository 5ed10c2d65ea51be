"""Tables and figures of an answer as files: what findings.json lists as CSV, SVG."""

from pathlib import Path

import pandas as pd

from observer_rt.foundation.outputs import replacing, write_text
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLISECOND, MM3_PER_MS
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.injections import Overlay
from observer_rt.identification.discovery.report.figures import gap_figure, overlay_figure

_LISTS = {
    "candidates.csv": "ranking",
    "disagreement.csv": "where",
    "standstill.csv": "checks",
    "residuals.csv": "injections",
    "masses.csv": "masses",
}
"""Tables that are lists of findings.json."""
_TABLES = (*_LISTS, "effects.csv", "gaps.csv")
_FIGURES = {"injections.svg": overlay_figure, "gaps.svg": gap_figure}
_XML = '<?xml version="1.0" encoding="utf-8"?>\n'


def write_data(folder: Path, findings: Findings) -> None:
    """Tables and figures into a folder, which is made."""
    folder.mkdir(exist_ok=True)
    lists = findings.as_json()
    for name, key in _LISTS.items():
        table = pd.json_normalize(lists[key], sep="_").drop(columns="parameters", errors="ignore")
        if "ids" in table:
            table["ids"] = table["ids"].str.join("+")
        if "ci95_pct" in table:
            table[["ci95_low_pct", "ci95_high_pct"]] = table.pop("ci95_pct").tolist()
        _write(folder / name, table)
    _write(folder / "effects.csv", _effects(findings))
    _write(folder / "gaps.csv", _gaps(findings))
    for number, overlay in enumerate(findings.overlays, start=1):
        _write(folder / f"injection_{number}.csv", _injection(overlay))
    for name, figure in _FIGURES.items():
        write_text(folder / name, _XML + figure(findings))


def remove_data(folder: Path) -> None:
    """Take away what an earlier run wrote there, and nothing else."""
    if folder.is_dir():
        for path in (*(folder / name for name in (*_TABLES, *_FIGURES)), *folder.glob("injection_[0-9].csv")):
            path.unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()


def _write(path: Path, table: pd.DataFrame) -> None:
    with replacing(path) as part:
        table.to_csv(part, index=False, float_format="%.10g")


def _effects(findings: Findings) -> pd.DataFrame:
    """Sizes of every effect of every candidate."""
    return pd.DataFrame(
        [
            ("+".join(one.ids), effect, name, size.unit, size.value, *size.ci95)
            for one in findings.ranking
            for effect, sizes in one.parameters.items()
            for name, size in sizes.items()
        ],
        columns=["candidate", "effect", "parameter", "unit", "value", "ci95_low", "ci95_high"],
    )


def _gaps(findings: Findings) -> pd.DataFrame:
    """Rms of model minus measurement; of the mass against the model with what was found where none is measured."""
    rows = [
        (findings.points[point.recording], gap.name, gap.unit, gap.before, gap.after, gap.noise_floor)
        for point in findings.gaps.points
        for gap in point.printed.values()
    ]
    columns = ["operating_point", "signal", "unit", "before", "after", "noise_alone"]
    table = pd.DataFrame(rows, columns=columns)
    return table if findings.shown.ids else table.assign(after=None)


def _injection(one: Overlay) -> pd.DataFrame:
    """The signals of one injection of the report, measured and modelled."""
    columns = {
        "time_ms": (one.time, MILLISECOND),
        "needle_lift_um": (one.lift, MICROMETRE),
        "line_pressure_MPa": (one.line_pressure, MEGAPASCAL),
        "line_pressure_as_given_MPa": (one.nominal_pressure, MEGAPASCAL),
        "line_pressure_amended_MPa": (one.amended_pressure, MEGAPASCAL),
        "injection_rate_mm3_per_ms": (one.measured_rate, MM3_PER_MS),
        "injection_rate_as_given_mm3_per_ms": (one.nominal_rate, MM3_PER_MS),
        "injection_rate_amended_mm3_per_ms": (one.amended_rate, MM3_PER_MS),
    }
    return pd.DataFrame({name: values / si for name, (values, si) in columns.items() if values is not None})
