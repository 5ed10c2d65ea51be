"""The parts of the report that show the gap: the map, typical injections, held-out operating points."""

from collections.abc import Sequence

from observer_rt.discovery.findings import Findings
from observer_rt.discovery.report.figures import Bars, Overlay, gap_figure, overlay_figure
from observer_rt.discovery.report.gap_map import legend, map_table, point_name
from observer_rt.discovery.report.html import figure, paragraph
from observer_rt.discovery.report.text import EQUATION_WORDS
from observer_rt.discovery.result import Discovery, Verdict
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS


def maps(findings: Findings) -> list[str]:
    """The map of disagreement before and after, and the equation that is violated."""
    after = (
        "With the amended model"
        if findings.discovery.effects
        else "With the best candidate, which is not enough"
    )
    before = map_table("Model as given", [(item.before, item) for item in findings.where], findings.points)
    if findings.discovery.verdict is Verdict.NONE:
        return [before, legend()]
    amended = map_table(after, [(item.after, item) for item in findings.where], findings.points)
    equations = dict.fromkeys(
        EQUATION_WORDS[item.equation] for item in findings.where if item.equation is not None
    )
    violated = " and ".join(equations)
    if findings.discovery.verdict is Verdict.UNKNOWN:
        said = f"It looks most like: {violated}. But no known effect of this kind is enough."
    else:
        said = f"Violated: {violated}."
    wide = " wide" if findings.gaps.injection_rate is not None else ""
    return [
        f'<div class="maps{wide}">{before}{amended}</div>',
        legend(),
        paragraph(said) if violated else "",
    ]


def typical_injections(found: Discovery, overlays: Sequence[Overlay]) -> list[str]:
    """Measured and modelled signals of single injections."""
    if not overlays:
        return []
    caption = (
        "The models follow the measurement up to the opening of the needle and run on their own from there, fed with "
        "the measured rail pressure and lift. Grey band: 95 % of what measurement noise alone leaves."
    )
    if found.effects:
        caption += " The amended model was fitted to other operating points than these."
    return [figure(overlay_figure(overlays), caption)]


def held_out(findings: Findings) -> list[str]:
    """The gaps at operating points the sizes were not fitted to."""
    gaps = findings.gaps
    first = {item.before.recording: item.before for item in findings.where}
    labels = [point_name(first[point.recording]).replace(", ", "\n") for point in gaps.points]
    amended = bool(findings.discovery.effects)
    pressures = tuple(point.line_pressure for point in gaps.points)
    groups = [Bars("line pressure", "MPa", MEGAPASCAL, pressures, amended)]
    rates = tuple(point.injection_rate for point in gaps.points if point.injection_rate is not None)
    masses = tuple(point.mass for point in gaps.points)
    if rates:
        groups.append(Bars("injection rate", "mm³/ms", MM3_PER_MS, rates, amended))
        groups.append(Bars("injected mass", "mg", MILLIGRAM, masses, amended))
    elif amended:
        groups.append(
            Bars("injected mass, against the amended model", "mg", MILLIGRAM, masses, amended=False)
        )
    apart = set(findings.held_out) != set(findings.fitted_on)
    how = (
        "For this picture the amended model was fitted to every second operating point and judged on the others, "
        "which are shown."
        if apart
        else "There is one operating point only: nothing is held out, the model is judged where it was fitted."
    )
    if not amended:
        how = "The model as given, on every second operating point."
    return [figure(gap_figure(labels, groups), how)]
