"""The next measurement in words and as a table, for the screen and the report."""

from rich.console import Console

from observer_rt.foundation.console import plain_table, say
from observer_rt.identification.planning.plan import DECIDED, MeasurementPlan

HEADINGS = (
    "step",
    "rail MPa",
    "energizing ms",
    "pause ms",
    "injections",
    "measure",
    "apart",
    "confidence",
    "mass mg",
)


def plan_words(plan: MeasurementPlan | None) -> str:
    """The open question, and whether a measurement would decide it."""
    if plan is None:
        return "nothing to plan: the answer is not ambiguous"
    left = "; or ".join(plan.rivals)
    if not plan.measurements:
        return f"to decide between {left}: no operating point could be simulated"
    best = plan.measurements[0].confidence
    if best < DECIDED:
        return (
            f"to decide between {left}: no operating point would (confidence now {plan.confidence:.2f}, {best:.2f} "
            "expected after the best)"
        )
    return f"to decide between {left} (confidence now {plan.confidence:.2f}), measure one of these, the best first:"


def plan_rows(plan: MeasurementPlan) -> list[tuple[str, ...]]:
    """Cells under HEADINGS, a step a row; mass: of an injection, as each explanation has it."""
    return [
        (
            f"{step}",
            f"{one.rail_pressure_MPa:g}",
            f"{one.energizing_ms:g}",
            f"{one.pause_ms:g}",
            f"{one.injections}",
            one.measure.value,
            "" if one.separation is None else f"{one.separation:.0f}",
            f"{one.confidence:.2f}",
            " / ".join(f"{mass:.2f}" for mass in one.masses_mg),
        )
        for step, one in enumerate(plan.measurements, 1)
    ]


def print_plan(plan: MeasurementPlan | None, console: Console) -> None:
    """Prints a plan."""
    say(console, plan_words(plan))
    if plan is not None and plan.measurements:
        numbers = [place for place, heading in enumerate(HEADINGS) if heading != "measure"]
        console.print(plain_table(HEADINGS, plan_rows(plan), right=numbers))
