"""Recordings of rigs and cases, and the model `observer-rt fit` makes of a rig before anything wears."""

from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.foundation.errors import RunError
from tools.benchmarks.campaign import BENCHMARKS, PACKAGE, PLANTS, digest_of
from tools.benchmarks.command_line import messages, tracked
from tools.benchmarks.discovery.asking import Asking, generate, seal
from tools.benchmarks.discovery.cases import GIVEN
from tools.benchmarks.discovery.real_line.cases import HIDING, RealPlan, Rig, hidden_text
from tools.benchmarks.wave_recordings import FITTED, NEW_PART, OUR_PROGRAM, fit_model, kept_fit, maker_file

HERE = Path(__file__).parent
HEALTHY, FIT_LOG, CASES = "healthy", "fit.txt", "cases"
NOMINAL_SOURCES = (
    PLANTS,
    *(BENCHMARKS / "discovery" / f"{name}.py" for name in ("hidden", "cases", "hiding", "answers")),
)
"""What, with the package, an answer of tier A depends on."""
HIDING_SOURCES = (
    *NOMINAL_SOURCES,
    *(HERE / f"{name}.py" for name in ("discrepancies", "hidden", "cases", "fitting")),
)
"""What, with the package, a fitted model and an answer depend on."""


@cache
def state_of_the_code() -> str:
    """Digest of all that a fitted model and an answer depend on."""
    return digest_of((PACKAGE, *HIDING_SOURCES))


def fitted_model(rig: Rig, sealed: Path, folder: Path, program: Sequence[str] = OUR_PROGRAM) -> Path:
    """The fitted injector file of a rig in a folder, what it was fitted to beside it; made anew if the code changed.

    Raises RunError where `fit` fails.
    """
    fitted = folder / FITTED

    def fit() -> None:
        recordings = generate(RealPlan.__module__, "healthy", sealed, rig.name, str(folder / HEALTHY))
        maker = folder / NEW_PART
        maker.write_text(maker_file())
        (folder / FIT_LOG).write_text(fit_model(recordings, maker, fitted, program))

    return kept_fit(fitted, f"{state_of_the_code()} {rig}", fit)


def fitted_models(
    rigs: Iterable[Rig | None], asking: Asking[Any], crashes: list[str]
) -> dict[Rig | None, Path]:
    """The fitted model of every rig, for None the nominal injector's; a line for every fit that failed."""
    models: dict[Rig | None, Path] = {None: NOMINAL_INJECTOR}
    ordered = sorted((rig for rig in set(rigs) if rig is not None), key=lambda rig: rig.name)
    for number, rig in enumerate(ordered, start=1):
        try:
            models[rig] = fitted_model(rig, asking.hidden, asking.out / "rigs" / rig.name, asking.program)
            messages.print(f"rig {number} of {len(ordered)}: fitted")
        except RunError as error:
            crashes.append(f"fit: rig {rig.name}: {error}")
    return models


def record_only(plan: RealPlan, out: Path, program: Sequence[str] = OUR_PROGRAM) -> None:
    """Write DIR/<discrepancy>/healthy, DIR/<discrepancy>/fitted.toml, DIR/cases/<label> and DIR/sealed.json.

    What is there already stays. A line for each case says what is in it.
    """
    seal(plan, out)
    cases = HIDING.opened(out)
    rigs = sorted({case.rig for case in cases}, key=lambda rig: rig.name)
    for rig in tracked(rigs, "fitting"):
        fitted_model(rig, out, out / rig.open_name, program)
    for case in tracked(cases, "recording"):
        folder = out / CASES / case.label
        if len(list(folder.glob("*.csv"))) < len(GIVEN):
            generate(RealPlan.__module__, "record", out, case.label, str(folder))
    for case in cases:
        messages.print(f"{case.label} {case.rig.open_name}: {hidden_text(case.parts)}", highlight=False)
