"""report.html: the answer first, then what it rests on, in one self-contained page."""

from observer_rt import __version__
from observer_rt.discovery.findings import Findings, Sources
from observer_rt.discovery.opinion import remark
from observer_rt.discovery.report import views
from observer_rt.discovery.report.figures import overlay_figure
from observer_rt.discovery.report.gap_map import LEGEND, gap_map
from observer_rt.discovery.report.printed_units import UNITS, sign
from observer_rt.discovery.report.text import EQUATION_WORDS, best_words, caveat_words, choices
from observer_rt.foundation.pages import templates_of
from observer_rt.model.effects import VOCABULARY

_PAGES = templates_of(__package__)
_PAGES.filters |= {
    "printed": views.printed_in,
    "sign": sign,
    "whole": views.whole,
    "with_sigma": views.with_sigma,
}
_PAGES.globals |= {
    "version": __version__,
    "vocabulary": VOCABULARY,
    "units": UNITS,
    "legend": LEGEND,
    "overlay_figure": overlay_figure,
    "remark": remark,
    "best_words": best_words,
    "caveat_words": caveat_words,
    "choices": choices,
    **{name: getattr(views, name) for name in views.FOR_TEMPLATES},
}


def report(findings: Findings, sources: Sources) -> str:
    """The page."""
    found, where = findings.discovery, findings.where
    after = "With what was found" if found.effects else f"Nearest, not enough: {' + '.join(found.best.ids)}"
    equations = dict.fromkeys(EQUATION_WORDS[item.equation] for item in where if item.equation is not None)
    return _PAGES.get_template("report.html.j2").render(
        findings=findings,
        found=found,
        sources=sources,
        map_before=gap_map("Model as given", [(item.before, item) for item in where], findings.points),
        map_after=gap_map(after, [(item.after, item) for item in where], findings.points),
        violated=" and ".join(equations),
    )
