"""`observer-rt reproduce`: the paper's figures, the table of ours beside them, and the report, into a folder."""

from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_bench
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.paper.figures import draw_figure_3, draw_figure_4, draw_figure_5
from observer_rt.paper.report import report
from observer_rt.paper.study import NOZZLE_WEAR, run_study
from observer_rt.paper.table import markdown, screen_table, write_csv
from observer_rt.terminal.compiling import show_compiling
from observer_rt.terminal.console import progress_bar, results, say
from observer_rt.terminal.destinations import check_folder


def reproduce_into(folder: Path, sample_rate: float, console: Console) -> None:
    """Run the study at `sample_rate` [Hz], write everything into `folder`, print the table.

    Raises `UserError` for a sample rate or a folder that will not do, before the work begins.
    """
    if folder.exists() and not folder.is_dir():
        raise UserError(f"--out {folder}", "is a file", "name a folder")
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder("--out", folder)
    show_compiling(console)
    with progress_bar(console, "reproducing", 1.0) as progress:
        study = run_study(load_bench(), sample_rate, progress)
    with file_errors(folder):
        draw_figure_3(folder / "figure_3.png", study)
        draw_figure_4(folder / "figure_4.png", study.case(NOZZLE_WEAR))
        draw_figure_5(folder / "figure_5.png", study)
        write_csv(folder / "table.csv", study)
        (folder / "table.md").write_text(markdown(study), encoding="utf-8")
        (folder / "report.md").write_text(report(study), encoding="utf-8")
    results().print(screen_table(study))
    say(console, f"figures 3 to 5, table and report in {folder}")
