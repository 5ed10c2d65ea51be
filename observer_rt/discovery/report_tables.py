"""Tables of the report: candidates, standstill checks, the observer's own indicators."""

import math
from collections.abc import Sequence
from html import escape

from observer_rt.discovery.check import Check
from observer_rt.discovery.opinion import Opinion, contradictions, remark
from observer_rt.discovery.page import callout, code, paragraph, table
from observer_rt.discovery.printed import printed, shown, significant
from observer_rt.discovery.result import Candidate, Discovery
from observer_rt.model.effects import VOCABULARY

_LONGEST_BAR = 120  # px
_CHECKS = (
    ("rail_line_offset", "line − rail pressure"),
    ("line_pressure_slope", "slope of line pressure"),
    ("rail_pressure_noise", "noise, rail pressure"),
    ("line_pressure_noise", "noise, line pressure"),
    ("needle_lift_noise", "noise, lift"),
    ("injection_rate_noise", "noise, rate"),
)
_UNIT_SIGNS = {"um": "µm", "us": "µs", "mm3/ms": "mm³/ms", "m3/(s Pa)": "m³/(s Pa)", "-": ""}


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
            "<br>".join(escape(size) for size in _sizes(candidate)),
            f"{gain:.0f}" if candidate.ids else "0",
            f'<span class="bar" style="width:{width}px"></span>' if candidate.ids else "",
            f"{candidate.statistic - best:.0f}",
        ]
        if held_out:
            gained = nominal.held_out - candidate.held_out
            row.append(f"{gained:.0f}" if math.isfinite(gained) else "no solution")
        rows.append(
            [*row, "" if candidate.plausible or not candidate.ids else "too small to matter, or at a bound"]
        )
    headings = ["candidate", "size", "gain", "", "behind best"]
    headings += ["held-out gain"] * held_out + [""]
    chosen = next((i for i, one in enumerate(found.ranking) if one.ids == winner), None)
    return [
        table(headings, rows, numbers=(2, 4, 5) if held_out else (2, 4), chosen=chosen),
        paragraph(
            "Gain: by how much -2 log L falls below that of the model as given; a difference of 16 and more between "
            "two candidates decides. Held-out gain: the same on operating points the sizes were not fitted to.",
            "note",
        ),
    ]


def _sizes(candidate: Candidate) -> list[str]:
    return [
        printed(effect_id, parameter).value_text
        for effect_id, parameters in zip(candidate.ids, candidate.parameters, strict=False)
        for parameter in parameters
    ]


def checks_table(checks: Sequence[Check], recordings: Sequence[str]) -> list[str]:
    """A row for each recording, and what the shut needle says of all together."""
    by_place = {(check.id, check.recording): check for check in checks}
    columns = [item for item in _CHECKS if any(check.id == item[0] for check in checks)]
    units = {check.id: check.unit for check in checks}
    headings = ["recording", *(f"{title}<br>[{units[name]}]" for name, title in columns)]
    rows = [
        [code(file), *(_figure(by_place.get((name, number))) for name, _ in columns)]
        for number, file in enumerate(recordings)
    ]
    apparent = [check for check in checks if check.recording is None]
    lines = [
        f"{code(check.id.removeprefix('apparent_'))} {_figure(check)} {_UNIT_SIGNS.get(check.unit, check.unit)}"
        for check in apparent
    ]
    return [
        table(headings, rows, numbers=range(1, len(headings))),
        paragraph(
            f"Apparent sizes while the needle is shut, each as if it were alone: {'; '.join(lines)}. "
            'What stands out is <span class="failed">red</span>; another effect may cause it.'
        ),
    ]


def _figure(check: Check | None) -> str:
    if check is None:
        return "–"
    if math.isnan(check.sigma):
        return f"{check.value:.3g}"
    step = significant(check.sigma)
    text = f"{shown(check.value, step)} ± {shown(check.sigma, step)}"
    return text if check.passed else f'<span class="failed">{text}</span>'


def opinion_parts(found: Discovery, opinion: Opinion | None) -> list[str]:
    """The observer's indicators beside what discovery found."""
    if opinion is None:
        return [paragraph("The observer could not be run on these recordings.", "note")]
    named = {effect.id: effect for effect in found.effects}
    rows = []
    for indicator in opinion.indicators:
        definition = VOCABULARY[indicator.effect_id].parameters[0]
        value, sigma = indicator.value / definition.si, indicator.sigma / definition.si
        step = significant(sigma) if sigma > 0.0 else 0.0
        unit = _UNIT_SIGNS.get(definition.unit, definition.unit)
        text = (
            shown(value, step) + ("" if math.isnan(sigma) else f" ± {shown(1.96 * sigma, step)}") + f" {unit}"
        )
        effect = named.get(indicator.effect_id)
        ours = printed(effect.id, effect.parameters[0]).value_text if effect is not None else "–"
        rows.append(
            [code(indicator.effect_id), f"<b>{text}</b>" if indicator.stands_out else text, escape(ours)]
        )
    against = contradictions(found, opinion)
    said = (
        callout("They contradict each other: " + "; ".join(escape(line) for line in against) + ".", "bad")
        if against
        else callout("Nothing here contradicts the discovery.", "good")
    )
    reasons = ", ".join(f"{reason} ({count})" for reason, count in opinion.reasons.items())
    judged = f"It declared {opinion.valid} of {opinion.injections} injections valid" + (
        f"; not valid for {escape(reasons)}." if reasons else "."
    )
    return [
        said,
        paragraph(
            "The observer of the daemon, started with the model as given, learned from all recordings one after "
            f"another. {judged} {escape(remark(found, opinion))}"
        ),
        table(("indicator", "observer, 95 %", "discovery"), rows),
    ]
