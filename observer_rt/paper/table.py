"""The table of ours beside the paper's scheme: on the screen, as CSV and as Markdown."""

import csv
import math
from pathlib import Path

from rich.table import Table
from rich.text import Text

from observer_rt.paper.comparison import Estimator, Study, WearCase

OBSERVERS = tuple(estimator for estimator in Estimator if estimator is not Estimator.MODEL)


def _ratio(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.2f}" if value < 100.0 else f"{float(f'{value:.3g}'):.0f}"


def _cells(case: WearCase) -> list[str]:
    return [
        f"{case.nozzle_wear:+.1f}",
        f"{case.mse(Estimator.MODEL):.2e}",
        *(_ratio(case.mse_ratio(estimator)) for estimator in OBSERVERS),
        *(f"{100 * case.mass_error(estimator):+.2f}" for estimator in Estimator),
        str(case.rejected),
    ]


HEADINGS = (
    "v_H",
    "MSE of x3, model",
    *(f"MSE ratio: {estimator}" for estimator in OBSERVERS),
    *(f"mass error [%]: {estimator}" for estimator in Estimator),
    "refused",
)


def screen_table(study: Study) -> Table:
    """For a terminal of 160 columns."""
    table = Table(
        title="x3-MSE of the model over that of each observer, and errors of the injected mass [%], by nozzle wear; "
        "the number is that of trainings",
        title_justify="left",
        box=None,
        padding=(0, 1),
    )
    for heading in HEADINGS:
        table.add_column(Text(heading.replace(": ", "\n").replace(", ", "\n")), justify="right")
    for case in study.cases:
        table.add_row(*_cells(case))
    return table


def write_csv(path: Path, study: Study) -> None:
    """Every number of the table, and the MSE of every estimator, unrounded."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                "v_H",
                *(f"x3_mse_{_key(estimator)}" for estimator in Estimator),
                *(f"x3_mse_ratio_{_key(estimator)}" for estimator in OBSERVERS),
                *(f"mass_error_pct_{_key(estimator)}" for estimator in Estimator),
                "refused_trainings_paper_10_tested",
            ]
        )
        for case in study.cases:
            ratios = (case.mse_ratio(estimator) for estimator in OBSERVERS)
            writer.writerow(
                [
                    case.nozzle_wear,
                    *(f"{case.mse(estimator):.6g}" for estimator in Estimator),
                    *("" if math.isnan(ratio) else f"{ratio:.6g}" for ratio in ratios),
                    *(f"{100 * case.mass_error(estimator):.6g}" for estimator in Estimator),
                    case.rejected,
                ]
            )


def markdown(study: Study) -> str:
    """The table as Markdown."""
    lines = ["| " + " | ".join(HEADINGS) + " |", "|" + "---:|" * len(HEADINGS)]
    lines += ["| " + " | ".join(_cells(case)) + " |" for case in study.cases]
    return "\n".join(lines) + "\n"


def _key(estimator: Estimator) -> str:
    return estimator.replace(", ", "_").replace(" ", "_")
