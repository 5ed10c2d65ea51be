"""The answer in words: for the screen, and the first lines of the report."""

from observer_rt.discovery.find import PHASE_NAMES
from observer_rt.discovery.findings import Findings, gap_share
from observer_rt.discovery.printed import printed
from observer_rt.discovery.result import Discovery, FittedEffect, Verdict
from observer_rt.model.effects import VOCABULARY
from observer_rt.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS


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
        place = found.unexplained
        where = ""
        if place is not None:
            where = (
                f"; it acts on the {place.equation.value.replace('_', ' ')} equation, most in phase "
                f"'{PHASE_NAMES[place.phase]}'"
            )
        return f"unknown: something is missing that no known effect explains{where} ({sure})"
    names = " and ".join(effect.id for effect in found.effects)
    if found.verdict is Verdict.AMBIGUOUS:
        others = ", or ".join(" and ".join(ids) for ids in found.rivals)
        return f"ambiguous: {names}" + (f", or {others}" if others else "") + f" ({sure})"
    return f"named: {names} ({sure})"


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
    lines = [
        f"  {name} {where}: {gap.before / si:.3g} {unit} off before, {gap.after / si:.3g} after "
        f"(noise alone {gap.noise_floor / si:.2g})"
        for name, gap, si, unit in parts
    ]
    if gaps.injection_rate is None and findings.discovery.effects:
        lines.append(
            f"  injected mass: the model given is {gaps.mass.before / MILLIGRAM:.2g} mg off, if this is right"
        )
    return lines
