"""Tables and figures of an answer as files: CSV in printed units, SVG."""

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from observer_rt.foundation.outputs import replacing, write_text
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MILLISECOND, MM3_PER_MS
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.gaps import PHASE_NAMES
from observer_rt.identification.discovery.injections import Overlay
from observer_rt.identification.discovery.report.figures import overlay_figure
from observer_rt.identification.discovery.report.page_figures import held_out_figure, with_words
from observer_rt.identification.discovery.report.text import printed
from observer_rt.identification.discovery.search.results import Cell

_TABLES = (
    *("effects.csv", "candidates.csv", "disagreement.csv", "gaps.csv", "standstill.csv"),
    *("residuals.csv", "masses.csv"),
)
_INJECTIONS_FIGURE, _GAPS_FIGURE = "injections.svg", "gaps.svg"
_XML = '<?xml version="1.0" encoding="utf-8"?>\n'

Row = Sequence[str | float | int | None]


def write_data(folder: Path, findings: Findings) -> None:
    """Tables and figures into a folder, which is made."""
    folder.mkdir(exist_ok=True)
    rows = (
        *(_effect_rows, _candidate_rows, _disagreement_rows, _gap_rows, _standstill_rows),
        *(_residual_rows, _mass_rows),
    )
    for name, table in zip(_TABLES, rows, strict=True):
        _write(folder / name, table(findings))
    label = with_words(findings)
    for number, overlay in enumerate(findings.overlays, start=1):
        _write(folder / f"injection_{number}.csv", _injection_rows(overlay))
    for name, svg in (
        (_INJECTIONS_FIGURE, overlay_figure(findings.overlays, label)),
        (_GAPS_FIGURE, held_out_figure(findings)),
    ):
        write_text(folder / name, _XML + svg)


def remove_data(folder: Path) -> None:
    """Take away what an earlier run wrote there, and nothing else."""
    if folder.is_dir():
        names = (*_TABLES, _INJECTIONS_FIGURE, _GAPS_FIGURE)
        for path in (*(folder / name for name in names), *folder.glob("injection_[0-9].csv")):
            path.unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()


def _write(path: Path, rows: Iterable[Row]) -> None:
    with replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([_text(value) for value in row] for row in rows)


def _text(value: str | float | None) -> str:
    """Ten digits; nothing for what there is not."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _effect_rows(findings: Findings) -> Iterator[Row]:
    yield "candidate", "effect", "parameter", "unit", "value", "ci95_low", "ci95_high"
    for candidate in findings.discovery.ranking:
        for effect_id, parameters in zip(candidate.ids, candidate.parameters, strict=True):
            for name, one in printed(effect_id, parameters).items():
                yield "+".join(candidate.ids), effect_id, name, one.unit, one.value, *one.ci95


def _candidate_rows(findings: Findings) -> Iterator[Row]:
    found = findings.discovery
    nominal = next(one for one in found.ranking if not one.ids)
    yield (
        *("candidate", "minus_2_log_l", "gain", "held_out_gain", "moves_line_pressure_rms_MPa"),
        *("moves_injected_mass_mg", "plausible"),
    )
    for one in found.ranking:
        yield (
            "+".join(one.ids) or "model as given",
            one.statistic,
            nominal.statistic - one.statistic,
            nominal.held_out - one.held_out,
            one.moves.line_pressure / MEGAPASCAL,
            one.moves.mass / MILLIGRAM,
            int(one.plausible),
        )


def _disagreement_rows(findings: Findings) -> Iterator[Row]:
    """Rows of the map: every signal in every phase at every operating point, before and after."""
    figures = ("ratio_to_noise", "colour", "significance_sigma", "rms")
    yield (
        *("operating_point", "rail_pressure_MPa", "open_ms", "signal", "unit", "phase"),
        *(f"{figure}_{when}" for when in ("before", "after") for figure in figures),
    )
    for item in findings.where:
        cell = item.before
        yield (
            findings.points[cell.recording],
            cell.rail_pressure / MEGAPASCAL,
            cell.duration / MILLISECOND,
            cell.signal.value,
            cell.signal.unit,
            PHASE_NAMES[cell.phase],
            *_numbers(cell),
            *_numbers(item.after),
        )


def _numbers(cell: Cell) -> Row:
    return math.sqrt(cell.variance), math.sqrt(cell.colour), cell.excess, cell.rms / cell.signal.si


def _gap_rows(findings: Findings) -> Iterator[Row]:
    """Rms of model minus measurement; of the mass against the model with what was found where none is measured."""
    after = bool(findings.shown.ids)
    yield "operating_point", "signal", "unit", "before", "after", "noise_alone"
    for point in findings.gaps.points:
        for gap in point.printed.values():
            left = gap.after if after else None
            yield findings.points[point.recording], gap.name, gap.unit, gap.before, left, gap.noise_floor


def _standstill_rows(findings: Findings) -> Iterator[Row]:
    yield "recording", "figure", "value", "sigma", "unit", "passed", "explained"
    for check in findings.checks:
        name = "" if check.recording is None else findings.files[check.recording]
        yield name, check.id, check.value, check.sigma, check.unit, int(check.passed), int(check.explained)


def _residual_rows(findings: Findings) -> Iterator[Row]:
    """Rms of model minus measured line pressure, injection by injection."""
    yield "operating_point", "injection", "before_MPa", "after_MPa"
    for one in findings.injections:
        yield findings.points[one.recording], one.number, one.before / MEGAPASCAL, one.after / MEGAPASCAL


def _mass_rows(findings: Findings) -> Iterator[Row]:
    """Change of the mean mass of an injection by what was found."""
    yield "operating_point", "as_given_mg", "change_mg", "ci95_half_mg"
    for one in findings.masses:
        change, half = one.change / MILLIGRAM, one.half / MILLIGRAM
        yield findings.points[one.recording], one.nominal / MILLIGRAM, change, half


def _injection_rows(one: Overlay) -> Iterator[Row]:
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
    there = {name: values / si for name, (values, si) in columns.items() if values is not None}
    yield tuple(there)
    yield from zip(*(values.tolist() for values in there.values()), strict=True)
