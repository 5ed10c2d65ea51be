"""Terms of an injector file: read, tried, refused by key."""

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.terms.bounds import TermDomain, refuse_unbounded


def term_domain(parameters: InjectorParameters) -> TermDomain:
    """Where terms of an injector must be sound."""
    line = parameters.line
    friction = line.loss_factor * parameters.fluid.density_line / line.area**2  # Pa/(m3/s)^2
    return TermDomain(parameters.seat.max_lift / MILLIMETRE, friction * MM3_PER_MS**2 / MEGAPASCAL)


def check_terms(place: str, parameters: InjectorParameters) -> None:
    """Refuse terms of an injector file that cannot be read, do not fit, or make no sound model.

    Raises `UserError` at a key below `place`.
    """
    domain = term_domain(parameters)
    for number, stated in enumerate(parameters.terms):
        here = f"{place}terms.{number}"
        try:
            term = stated.term
        except UserError as error:
            raise UserError(f"{here}.{error.place}", error.problem, error.remedy) from None
        try:
            refuse_unbounded(term, domain)
        except UserError as error:
            raise UserError(f"{here}.law", f"'{error.place}' {error.problem}", error.remedy) from None
