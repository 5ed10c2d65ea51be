"""The answer in words: for the screen, and the first lines of the report."""

from observer_rt.discovery.findings import Findings, gap_share
from observer_rt.discovery.report.printed_units import printed
from observer_rt.discovery.search.result import Discovery, FittedEffect, Verdict
from observer_rt.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.model.effect import Equation
from observer_rt.model.effects import VOCABULARY

EQUATION_WORDS = {
    Equation.LINE_PRESSURE: "the balance of the line, p_L' = K_L/V_L (Q_L - Q_H), (20)",
    Equation.LINE_FLOW: "the flow through the line, Q_L' = ..., (19)",
    Equation.SAC_PRESSURE: "the balance of the sac, p_S' = K_C/V_S (Q_S - Q_H), with (21) and (23)",
    Equation.INPUT: "an input: rail pressure, lift or chamber pressure is not what it is taken for",
    Equation.OUTPUT: "the output: the line-pressure sensor does not show p_L",
}

PHASE_WORDS = {
    Phase.STANDSTILL: "while the needle is shut",
    Phase.OPENING: "while the needle opens",
    Phase.OPEN: "while the needle is open",
    Phase.CLOSING: "while the needle closes",
    Phase.AFTER: "right after the needle has closed",
}


def as_text(findings: Findings) -> str:
    """A few lines: verdict, effects with intervals, the gap before and after."""
    found = findings.discovery
    lines = [headline(found)]
    for effect in found.effects:
        lines.append(f"  {effect_text(effect)}; explains {gap_share(found, effect):.0%} of the disagreement")
    for decisive in found.decide_by:
        lines.append(f"  to tell {' from '.join(decisive.separates)}: {decisive.measurement}")
    if found.unexplained is not None:
        lines.append(f"  {found.unexplained.term}")
    return "\n".join([*lines, *gap_lines(findings)])


def headline(found: Discovery) -> str:
    """The verdict in one sentence."""
    sure = f"confidence {found.confidence:.2f}"
    if found.verdict is Verdict.NONE:
        return f"none: the model explains the recordings; no effect is missing ({sure})"
    if found.verdict is Verdict.UNKNOWN:
        return f"unknown: something is missing that no known effect explains{where_words(found)} ({sure})"
    names = " and ".join(effect.id for effect in found.effects)
    if found.verdict is Verdict.AMBIGUOUS:
        others = ", or ".join(" and ".join(ids) for ids in found.rivals)
        return f"ambiguous: {names}" + (f", or {others}" if others else "") + f" ({sure})"
    return f"named: {names} ({sure})"


def where_words(found: Discovery) -> str:
    """Where something unknown acts, to be appended to a sentence."""
    place = found.unexplained
    if place is None:
        return ""
    equation = place.equation.value.replace("_", " ")
    return f"; it shows most {PHASE_WORDS[place.phase]}, as if the {equation} equation were wrong"


def effects_words(found: Discovery) -> str:
    """The effects with their sizes and intervals, for a title."""
    return " and ".join(
        f"{effect.id.replace('_', ' ')}, "
        + ", ".join(
            f"{p.value_text} ({p.interval_text})" for p in (printed(effect.id, q) for q in effect.parameters)
        )
        if effect.parameters
        else effect.id.replace("_", " ")
        for effect in found.effects
    )


def effect_text(effect: FittedEffect) -> str:
    """An effect with its sizes."""
    sizes = ", ".join(printed(effect.id, parameter).text for parameter in effect.parameters)
    others = f" [or {', '.join(effect.indistinguishable_from)}]" if effect.indistinguishable_from else ""
    return f"{effect.id}{others}: {sizes or VOCABULARY[effect.id].sentence}"


def gap_lines(findings: Findings) -> list[str]:
    """The gaps on held-out operating points."""
    gaps = findings.gaps
    apart = set(findings.held_out) != set(findings.fitted_on)
    where = "on recordings held out" if apart else "on the recordings"
    parts = [("line pressure", gaps.line_pressure, MEGAPASCAL, "MPa")]
    if gaps.injection_rate is not None:
        parts.append(("injection rate", gaps.injection_rate, MM3_PER_MS, "mm3/ms"))
        parts.append(("injected mass", gaps.mass, MILLIGRAM, "mg"))
    lines = []
    for name, gap, si, unit in parts:
        after = f" before, {gap.after / si:.3g} after" if findings.discovery.effects else ""
        alone = f"(noise alone {gap.noise_floor / si:.2g})"
        lines.append(f"  {name} {where}: {gap.before / si:.3g} {unit} off{after} {alone}")
    if gaps.injection_rate is None and findings.discovery.effects:
        lines.append(
            f"  injected mass: the model given is {gaps.mass.before / MILLIGRAM:.2g} mg off, if this is right"
        )
    return lines
