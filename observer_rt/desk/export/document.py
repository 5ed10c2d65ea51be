"""A frozen observer as JSON: parameters, effective coefficients, equations and laws, what was learned."""

from typing import Any

from observer_rt import __version__
from observer_rt.daemon.persistence.state_file import model_hash
from observer_rt.desk.export.coefficients import effective_coefficients, equations
from observer_rt.desk.export.frozen import Frozen
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.terms.in_force import TermInForce

SCHEMA = 1


def document_of(frozen: Frozen, parameters: InjectorParameters) -> dict[str, Any]:
    """The document; parameters: as the injector file states them, which the coefficients come from."""
    model, it, network = frozen.model, frozen.constants, frozen.network
    return {
        "schema": SCHEMA,
        "observer_rt": __version__,
        "name": frozen.name,
        "model_sha256": model_hash(parameters),
        "phi_version": frozen.phi_version,
        "sample_rate_Hz": frozen.sample_rate,
        "parameters": parameters.model_dump(mode="json", exclude={"baseline", "remainder"}),
        "effective_parameters": model.injector.model_dump(
            mode="json", exclude={"baseline", "remainder", "effects", "terms"}
        ),
        "departures": model.departures._asdict(),
        "coefficients": [each._asdict() for each in effective_coefficients(frozen)],
        "equations": list(equations(frozen)),
        "terms": [
            TermInForce.of(term).model_dump(mode="json", include={"equation", "law", "coefficient"})
            for term in frozen.terms
        ],
        "phi": {
            "V": network.hidden.tolist(),
            "W": network.output.tolist(),
            "bias": network.bias.tolist(),
        },
        "observer": {
            "substeps": it.substeps,
            "lookahead_samples": it.timing.lookahead,
            "settle_samples": it.timing.settle,
            "opens_above_m": frozen.opens_above,
            "shuts_below_m": frozen.shuts_below,
            "steady_gain": frozen.gains[-1].tolist(),
            "offset_follows": frozen.offset_moves,
        },
    }
