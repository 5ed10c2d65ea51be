"""Terms as effects, so that recordings can be simulated with them."""

from observer_rt.model.effect import Component, Effect
from observer_rt.model.terms.term import Term


def effect_of(term: Term) -> Effect:
    """A term as an effect without a size."""
    return Effect(str(term), Component.LINE_FLOW, (), lambda model, _: model.with_term(term), "", "")
