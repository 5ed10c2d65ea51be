"""Tables of the report: effects, candidates, what is undecided, standstill checks."""

import math
from collections.abc import Sequence
from html import escape

from observer_rt.discovery.evidence.standstill import StandstillFigure
from observer_rt.discovery.findings import Findings
from observer_rt.discovery.report.html import code, paragraph, table
from observer_rt.discovery.report.printed_units import UNIT_SIGNS, printed, shown, significant
from observer_rt.discovery.result import Candidate, Consequence, Discovery, FittedEffect
from observer_rt.discovery.search.search import indistinguishable
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.model.effect import Apparent
from observer_rt.model.effects import VOCABULARY

LEAST_MASS = 0.01 * MILLIGRAM  # kg, below which a change or gap is not worth a number
_LONGEST_BAR = 120  # px
_CHECKS = (
    ("rail_line_offset", "line − rail pressure"),
    ("line_pressure_slope", "slope of line pressure"),
    ("rail_pressure_noise", "noise, rail pressure"),
    ("line_pressure_noise", "noise, line pressure"),
    ("needle_lift_noise", "noise, lift"),
    ("injection_rate_noise", "noise, rate"),
)


def effects_table(findings: Findings) -> list[str]:
    """The effects found: size, interval, confidence, what they do to pressure and mass."""
    found = findings.discovery
    rows = [_row(effect, found) for effect in found.effects]
    if not rows:
        return []
    headings = (
        "effect",
        "size",
        "95&nbsp;%",
        "confidence",
        "moves p<sub>L</sub>",
        "and mass",
        "how it shows",
    )
    return [
        table(headings, rows),
        paragraph(f"Confidence: {escape(found.confidence_method)}.", "note"),
    ]


def _row(effect: FittedEffect, found: Discovery) -> list[str]:
    definition = VOCABULARY[effect.id]
    sizes = [printed(effect.id, parameter) for parameter in effect.parameters]
    return [
        code(effect.id),
        "<br>".join(_whole(size.value_text) for size in sizes) or "in force",
        "<br>".join(_whole(size.interval_text) for size in sizes),
        f"{found.confidence:.2f}",
        _whole(f"{moved_pressure(effect.moves)} MPa"),
        _whole(f"{moved_mass(effect.moves)} mg"),
        escape(definition.signature),
    ]


def _whole(text: str) -> str:
    """Text that is not broken into lines."""
    return escape(text).replace(" ", "&nbsp;")


def ranking_table(found: Discovery) -> list[str]:
    """Candidates, best first, by what they explain."""
    nominal = next(candidate for candidate in found.ranking if not candidate.ids)
    best = found.ranking[0].statistic
    most = max(nominal.statistic - best, 1.0)
    held_out = not math.isnan(nominal.held_out)
    winner = tuple(effect.id for effect in found.effects)
    rows = []
    for candidate in found.ranking:
        gain = nominal.statistic - candidate.statistic
        width = max(1, round(_LONGEST_BAR * max(gain, 0.0) / most))
        row = [
            " + ".join(code(one) for one in candidate.ids) or "model as given",
            "<br>".join(_whole(size) for size in _sizes(candidate)),
            f"{gain:.0f}" if candidate.ids else "0",
            f'<span class="bar" style="width:{width}px"></span>' if candidate.ids else "",
            f"{candidate.statistic - best:.0f}",
            moved_pressure(candidate.moves) if candidate.ids else "",
            moved_mass(candidate.moves) if candidate.ids else "",
        ]
        if held_out:
            gained = nominal.held_out - candidate.held_out
            row.append(f"{gained:.0f}" if math.isfinite(gained) else "no solution")
        rows.append([*row, "" if candidate.plausible or not candidate.ids else "too small, or at a bound"])
    headings = [
        "candidate",
        "size",
        "gain",
        "",
        "behind<br>best",
        "moves p<sub>L</sub><br>[MPa]",
        "and mass<br>[mg]",
    ]
    headings += ["held-out<br>gain"] * held_out + [""]
    chosen = next((i for i, one in enumerate(found.ranking) if one.ids == winner), None)
    return [
        table(headings, rows, numbers=(2, 4, 5, 6, 7) if held_out else (2, 4, 5, 6), chosen=chosen),
        paragraph(
            "Gain: by how much -2 log L falls below that of the model as given; a difference of 16 and more between "
            "two candidates decides. It moves: rms of the line pressure and mean of the mass, against the model as "
            "given. Held-out gain: the same on operating points the sizes were not fitted to.",
            "note",
        ),
    ]


def moved_pressure(moved: Consequence) -> str:
    """By how much the line pressure moves, in MPa."""
    return f"{moved.line_pressure / MEGAPASCAL:.2g}"


def moved_mass(moved: Consequence) -> str:
    """By how much the injected mass moves, in mg."""
    return f"{moved.mass / MILLIGRAM:+.2g}" if abs(moved.mass) >= LEAST_MASS else "0"


def _sizes(candidate: Candidate) -> list[str]:
    return [
        printed(effect_id, parameter).value_text
        for effect_id, parameters in zip(candidate.ids, candidate.parameters, strict=True)
        for parameter in parameters
    ]


def checks_table(checks: Sequence[StandstillFigure], recordings: Sequence[str]) -> list[str]:
    """A row for each recording, and what the shut needle says of all together."""
    by_place = {(check.id, check.recording): check for check in checks}
    columns = [item for item in _CHECKS if any(check.id == item[0] for check in checks)]
    units = {check.id: UNIT_SIGNS.get(check.unit, check.unit) for check in checks}
    headings = ["recording", *(f"{title}<br>[{units[name]}]" for name, title in columns)]
    rows = [
        [code(file), *(_figure(by_place.get((name, number))) for name, _ in columns)]
        for number, file in enumerate(recordings)
    ]
    settled, left = (
        "; ".join(
            f"{code(name)} {_figure(check)} {UNIT_SIGNS.get(check.unit, check.unit)}"
            for check in checks
            if check.recording is None
            and VOCABULARY[name := check.id.removeprefix("apparent_")].apparent is how
        )
        for how in Apparent
    )
    return [
        table(headings, rows, numbers=range(1, len(headings))),
        paragraph(f"While the needle is shut, each as if it were alone: {settled}.") if settled else "",
        paragraph(f"Left beside what was found: {left}.") if left else "",
        paragraph('What stands out is <span class="failed">red</span>; another effect may cause it.', "note"),
    ]


def _figure(check: StandstillFigure | None) -> str:
    if check is None:
        return "–"
    if math.isnan(check.sigma):
        return f"{check.value:#.3g}"
    step = significant(check.sigma)
    text = f"{shown(check.value, step)} ± {shown(check.sigma, step)}"
    return text if check.passed else f'<span class="failed">{text}</span>'


def undecided(found: Discovery) -> list[str]:
    """Rivals, and the measurements that would decide."""
    rows = [
        [" / ".join(code(one) for one in item.separates), escape(item.measurement)]
        for item in found.decide_by
    ]
    parts = []
    if found.rivals:
        others = "; ".join(" with ".join(code(one) for one in ids) for ids in found.rivals)
        parts.append(paragraph(f"These recordings are explained as well by: {others}."))
    if rows:
        parts.append(table(("to tell apart", "measure"), rows))
    for effect in found.effects:
        same = indistinguishable(VOCABULARY[effect.id])
        if same:
            parts.append(
                paragraph(
                    f"{code(effect.id)} and {', '.join(code(one) for one in same)} have the same effect on every "
                    "signal; either name is right for the model."
                )
            )
    if not parts and found.effects:
        parts.append(
            paragraph(
                "Nothing: whatever else has as many effects explains the recordings significantly worse, and one "
                "effect more adds too little to be believed."
            )
        )
    return parts
