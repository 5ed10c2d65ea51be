"""Builds report.html: the answer first, then what it rests on, in words and units."""

from observer_rt.foundation.files import templates_of
from observer_rt.identification.discovery.findings import Findings, Sources
from observer_rt.identification.discovery.report import page_answer, page_figures, page_tables, text
from observer_rt.identification.discovery.report.figures import laws_figure, overlay_figure
from observer_rt.identification.discovery.report.formula import formula
from observer_rt.identification.discovery.report.gap_map import gap_map, legend, violated_words
from observer_rt.identification.discovery.report.page_figures import with_words
from observer_rt.identification.discovery.report.plan import HEADINGS, plan_rows, plan_words

_PAGES = templates_of(__package__)
for _module in (text, page_answer, page_figures, page_tables):
    _PAGES.globals |= vars(_module)
_PAGES.globals |= {
    "formula": formula,
    "overlay_figure": overlay_figure,
    "laws_figure": laws_figure,
    "PLAN_HEADINGS": HEADINGS,
    "plan_rows": plan_rows,
    "plan_words": plan_words,
}


def report(findings: Findings, sources: Sources) -> str:
    """The page."""
    found, where = findings.discovery, findings.where
    nearest = f"Nearest, not enough: {' + '.join(found.best.ids)}"
    after = f"{with_words(findings)[:1].upper()}{with_words(findings)[1:]}" if findings.shown.ids else nearest
    return _PAGES.get_template("report.html.j2").render(
        findings=findings,
        found=found,
        sources=sources,
        map_before=gap_map("Model as given", [(item.before, item) for item in where], findings.points),
        map_after=gap_map(after, [(item.after, item) for item in where], findings.points),
        violated=violated_words(findings),
        legend=legend(),
    )
