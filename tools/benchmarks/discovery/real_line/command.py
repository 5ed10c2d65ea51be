"""`tools/bench discovery --tier B`."""

from dataclasses import replace

from observer_rt.foundation.errors import UserError
from tools.benchmarks.discovery.real_line.cases import names_of, shared_out
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.discovery.real_line.generator import RealPlan

CASES = 150


def plan_of(
    cases: int | None,
    healthy: int | None,
    chosen: str,
    rates: tuple[bool, ...],
    discrepancies: list[Discrepancy] | None,
    seed: int,
) -> RealPlan:
    """A plan by the options of the command. Raises `UserError` for an effect that is not known."""
    names = tuple(name for name in chosen.split(",") if name)
    for name in names:
        try:
            names_of(name)
        except KeyError as error:
            raise UserError("--effects", f"unknown: {error.args[0]}", "give a, a+b or healthy") from None
    numbers = shared_out(CASES if cases is None else cases)
    if healthy is not None:
        numbers = replace(numbers, healthy=healthy)
    return RealPlan(numbers, rates, tuple(map(str, discrepancies or Discrepancy)), seed, names)
