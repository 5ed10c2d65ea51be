"""Laws of terms as text of C and of MATLAB; what remembers has places in a memory."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from observer_rt.model.terms.law import (
    Applied,
    Coefficient,
    Lagged,
    Law,
    Number,
    Operation,
    Quantity,
    Ringing,
    Tabulated,
)
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable

_SIGNS = {
    Operation.ADD: "+",
    Operation.SUBTRACT: "-",
    Operation.MULTIPLY: "*",
    Operation.GREATER: ">",
    Operation.LESS: "<",
}
_C_FUNCTIONS = {
    Operation.DIVIDE: "inj_law_quotient",
    Operation.POWER: "inj_law_power",
    Operation.SQRT: "inj_law_root",
    Operation.MIN: "inj_law_min",
    Operation.MAX: "inj_law_max",
    Operation.ABS: "r_fabs",
    Operation.EXP: "r_exp",
    Operation.LOG: "r_log",
    Operation.SIN: "r_sin",
    Operation.COS: "r_cos",
    Operation.TANH: "r_tanh",
}


def real(value: float) -> str:
    """A number of C in the precision that is compiled for."""
    return f"R({value!r})" if value >= 0.0 else f"R(-{-value!r})"


@dataclass
class Places:
    """Places handed out so far to laws that remember; ringings: frequency [kHz] and damping, by place."""

    lags: int
    ringings: list[tuple[float, float]]


@dataclass(frozen=True)
class CLaws:
    """Statements of C that add up the laws of model and sensor, and what they need."""

    of_model: Sequence[str]
    of_sensor: Sequence[str]
    lags: int
    ringings: Sequence[tuple[float, float]]
    ringings_of_sensor: range
    reads_flows: bool


def c_laws(terms: Sequence[Term], known: Mapping[Variable, float]) -> CLaws:
    """Terms as C. known: variables that stay as they are."""
    places = Places(0, [])
    ordered = sorted(terms, key=lambda term: term.equation is TermEquation.LINE_PRESSURE_SENSOR)
    of_model: list[str] = []
    of_sensor: list[str] = []
    first = 0
    for term in ordered:
        is_sensors = term.equation is TermEquation.LINE_PRESSURE_SENSOR
        text = _in_c(term.law, term.coefficient, known, places)
        place = f"LAW_OF_{term.equation.name}"
        lines = of_sensor if is_sensors else of_model
        lines.append(f"/* {term} */".replace("\n", " "))
        lines.append(
            f"totals[{place}] = inj_law_held(totals[{place}] + inj_law_held({text}, {place}), {place});"
        )
        if not is_sensors:
            first = len(places.ringings)
    read = {variable for term in terms for variable in term.law.variables}
    return CLaws(
        of_model,
        of_sensor,
        places.lags,
        places.ringings,
        range(first, len(places.ringings)),
        not read.isdisjoint({Variable.SEAT_FLOW, Variable.NOZZLE_FLOW}),
    )


def _in_c(law: Law, c: float, known: Mapping[Variable, float], places: Places) -> str:
    def text(part: Law) -> str:
        return _in_c(part, c, known, places)

    match law:
        case Number():
            return real(law.reckoned)
        case Coefficient():
            return real(c)
        case Quantity(variable):
            return real(known[variable]) if variable in known else f"v[LAW_{variable.name}]"
        case Lagged(argument, milliseconds):
            inner, place = text(argument), places.lags
            places.lags += 1
            return f"inj_law_lagged(&memory->lags[{place}], {inner}, interval_ms / {real(milliseconds)})"
        case Ringing(argument, kilohertz, damping):
            inner, place = text(argument), len(places.ringings)
            places.ringings.append((kilohertz, damping))
            numbers = f"{real(kilohertz)}, {real(damping)}"
            return f"inj_law_ringing(memory->ringings[{place}], {inner}, {numbers}, interval_ms)"
        case Tabulated():
            return text(law.spelled)
        case Applied(operation, arguments):
            return _applied(operation, [text(one) for one in arguments])
    raise TypeError(f"no law: {law!r}")


def _applied(operation: Operation, arguments: Sequence[str]) -> str:
    if operation is Operation.NEGATE:
        return f"(-{arguments[0]})"
    if operation in (Operation.GREATER, Operation.LESS):
        return f"(({arguments[0]} {_SIGNS[operation]} {arguments[1]}) ? R(1.0) : R(0.0))"
    if operation in _SIGNS:
        return f"({arguments[0]} {_SIGNS[operation]} {arguments[1]})"
    return f"{_C_FUNCTIONS[operation]}({', '.join(arguments)})"
