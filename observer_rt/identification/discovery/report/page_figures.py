"""Figures of the page as <svg>: gaps held out, residuals of injections."""

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.report.figures import (
    Bars,
    RecordingResiduals,
    gap_figure,
    residual_figure,
)
from observer_rt.identification.discovery.report.numbers import sign
from observer_rt.identification.likelihood.operating_points import point_name


def held_out_figure(findings: Findings) -> str:
    """The gaps at operating points the sizes were not fitted to, as <svg>."""
    gaps, amended = findings.gaps, bool(findings.shown.ids)
    places = {i.before.recording: (i.before.rail_pressure, i.before.duration) for i in findings.where}
    labels = [point_name(*places[point.recording]).replace(", ", "\n") for point in gaps.points]
    label = with_words(findings) if amended else None
    of_points = [point.printed for point in gaps.points]
    groups = []
    for name, gap in gaps.printed.items():
        every = tuple(printed[name] for printed in of_points if name in printed)
        if gap.measured:
            groups.append(Bars(gap.words, sign(gap.unit), every, label))
        elif amended:
            groups.append(Bars(f"{gap.words}, if this is right", gap.unit, every, None))
    return gap_figure(labels, groups)


def injections_figure(findings: Findings) -> str:
    """What the models miss of every injection, recording by recording, as <svg>."""
    held_out = set(findings.gaps.held_out) if findings.held_apart else set()
    groups = []
    for number in dict.fromkeys(one.recording for one in findings.injections):
        of_one = [one for one in findings.injections if one.recording == number]
        before, after = ([getattr(one, name) / MEGAPASCAL for one in of_one] for name in ("before", "after"))
        groups.append(RecordingResiduals(point_words(findings, number), before, after, number in held_out))
    floor = findings.gaps.line_pressure.noise_floor / MEGAPASCAL
    return residual_figure(groups, floor, with_words(findings) if findings.shown.ids else None)


def point_words(findings: Findings, recording: int) -> str:
    """Names the operating point of a recording."""
    cell = next(one.before for one in findings.where if one.before.recording == recording)
    return point_name(cell.rail_pressure, cell.duration)


def with_words(findings: Findings) -> str:
    """The model with what was found, for a legend."""
    found = findings.discovery
    if found.effects or findings.proposal is None:
        return f"with {' and '.join(found.named.ids)}"
    return f"with proposal {found.proposals.index(findings.proposal) + 1}"
