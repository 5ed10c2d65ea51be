"""The part of the report that shows what the learning observer says of the same recordings."""

from html import escape

from observer_rt.discovery.opinion import Opinion, contradictions, remark
from observer_rt.discovery.report.html import callout, code, paragraph, table
from observer_rt.discovery.report.printed_units import UNIT_SIGNS, printed, shown, significant
from observer_rt.discovery.result import Discovery
from observer_rt.model.effects import VOCABULARY


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
        unit = UNIT_SIGNS.get(definition.unit, definition.unit)
        text = f"{shown(value, step)} ± {shown(1.96 * sigma, step)} {unit}" if sigma > 0.0 else "not needed"
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
