"""Units within a law: checked, and that of its coefficient derived.

A bare number takes whatever unit makes the law right, and so does what it is multiplied with; a number with a unit,
a variable and `c` have one.
"""

from observer_rt.foundation.errors import UserError
from observer_rt.model.terms.law import Call, Coefficient, Lag, Law, LawTable, Number, Operation, Quantity, Resonance
from observer_rt.model.terms.term import PURE, TermEquation, Unit, unit_named

_ALIKE = (Operation.ADD, Operation.SUBTRACT, Operation.GREATER, Operation.LESS, Operation.MIN, Operation.MAX)
_COMPARED = (Operation.GREATER, Operation.LESS)
_KEPT = (Operation.NEGATE, Operation.ABS)


def coefficient_unit(equation: TermEquation, law: Law) -> Unit | None:
    """The unit that `c` must have; None where the law leaves it open, or has none.

    Raises `UserError` for a law whose units do not fit together, or not the equation.
    """
    check = _Check()
    check.alike(check.unit_of(law), equation.unit, f"'{law}'", f"what {equation} adds")
    return check.coefficient


class _Check:
    """Units of parts, None where open. coefficient: the unit of `c`, as soon as it is known."""

    def __init__(self) -> None:
        self.coefficient: Unit | None = None

    def unit_of(self, law: Law) -> Unit | None:
        """The unit of a law; refuses what does not fit in it."""
        match law:
            case Number(_, name):
                factor_and_unit = unit_named(name)
                return None if factor_and_unit is None else factor_and_unit[1]
            case Coefficient():
                return self.coefficient or Unit(c=1.0)
            case Quantity(variable):
                return variable.unit
            case Lag(argument) | Resonance(argument):
                return self.unit_of(argument)
            case LawTable(argument, points, values):
                point_unit = self.unit_of(argument)
                for point in points:
                    self.alike(point_unit, self.unit_of(point), f"in '{law}', '{argument}'", f"the point {point}")
                unit = self.unit_of(values[0])
                for value in values[1:]:
                    unit = self.alike(unit, self.unit_of(value), f"in '{law}', {values[0]}", f"{value}")
                return unit
            case Call(operation, arguments):
                return self._of_operation(law, operation, arguments)
        raise TypeError(f"no law: {law!r}")

    def alike(self, left: Unit | None, right: Unit | None, first: str, second: str) -> Unit | None:
        """The unit of two operands; refuses units that differ. first, second: the operands as text."""
        if left is None or right is None:
            return left or right
        if left.c != right.c and self.coefficient is None:
            remaining = right._replace(c=0.0).times(left._replace(c=0.0), -1.0)
            self.coefficient = remaining.to(1.0 / (left.c - right.c))
        left, right = self._resolved(left), self._resolved(right)
        if left != right:
            raise UserError(
                "units",
                f"{first} is in {left}, {second} is in {right}",
                "give a number the missing unit, such as 100[MPa], or correct the law",
            )
        return left

    def _resolved(self, unit: Unit) -> Unit:
        """The unit with that of `c` put in."""
        if self.coefficient is None:
            return unit
        return unit._replace(c=0.0).times(self.coefficient, unit.c)

    def _of_operation(self, law: Law, operation: Operation, arguments: tuple[Law, ...]) -> Unit | None:
        units = [self.unit_of(one) for one in arguments]
        first = units[0]
        if operation in _ALIKE:
            unit = self.alike(first, units[1], f"in '{law}', '{arguments[0]}'", f"'{arguments[1]}'")
            return PURE if operation in _COMPARED else unit
        if operation in (Operation.MULTIPLY, Operation.DIVIDE):
            if first is None or units[1] is None:
                return None
            return first.times(units[1], 1.0 if operation is Operation.MULTIPLY else -1.0)
        if operation in _KEPT:
            return first
        if operation in (Operation.SQRT, Operation.POWER):
            exponent = arguments[1] if operation is Operation.POWER else Number(0.5)
            assert isinstance(exponent, Number)
            return None if first is None else first.to(exponent.value)
        return self.alike(first, PURE, f"in '{law}', '{arguments[0]}'", f"what {operation.name.lower()}() takes")
