"""A frozen model as functions of MATLAB or Octave: effective coefficients, and the right-hand side of a lump."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from observer_rt import __version__
from observer_rt.desk.export.coefficients import effective_coefficients, equations
from observer_rt.desk.export.frozen import Frozen
from observer_rt.model.line.wave import WaveLine

COEFFICIENTS, RATES = "injector_coefficients.m", "injector_rates.m"
_RATES = """function [dx, injection_rate] = injector_rates(x, u, c)
%INJECTOR_RATES Right-hand side of the injector for a solver, and its injection rate [m3/s].
%   x = [x1; x2; x3], u = [u1; u2], normalised as c.equations says; c = injector_coefficients().
z = [x(1); x(2); x(3); u(1); u(2); 1];
n = c.W * tanh(c.V * z) + c.bias;
is_open = double(u(2) > 0);
rise = is_open * (c.chamber_rise + c.learned_rise + (c.chamber_rise_with_seat + c.learned_rise_with_seat) * u(2));
d = x(3) - rise;
margin = c.vapour_margin + rise;
cavitates = double(c.critical_excess ~= 0 && margin < c.critical_excess * d);
ratio = (1 + margin / (d + (1 - cavitates))) / (1 + c.critical_excess);
q_H = d / (d^2 + c.transition^2)^0.25 * (1 + cavitates * (sqrt(max(ratio, 0)) - 1)) * (1 + n(1));
q_S = u(2) * (x(1) - x(3)) / ((x(1) - x(3))^2 + c.transition^2)^0.25 * (1 + n(2));
is_resting = double(u(2) <= 0 && x(3) == 0);
q_H = (1 - is_resting) * q_H;
q_S = (1 - is_resting) * q_S;
K = max(1 + c.stiffness_slope * (x(1) - c.stiffness_pressure), 0.05);
p = max(x(1) + c.chamber_pressure, 0.01);
K = K * p / (p + K * c.air);
dx1 = K * (c.a1 * x(2) - c.a2_nozzle * q_H - c.a2_seat * q_S - c.leak * x(1));
dx2 = c.a3 * (u(1) - x(1)) - c.a4 * x(2) * abs(x(2));
dx3 = c.a5 * q_S - c.a6 * q_H;
dx = [dx1; dx2; dx3];
injection_rate = c.nozzle_flow * q_H;
end
"""


def matlab_files(frozen: Frozen) -> Mapping[str, str]:
    """Files by name; the rates only of a lump without laws of its own, for which they are the whole model."""
    found = {COEFFICIENTS: "\n".join(_coefficients(frozen)) + "\n"}
    if not (isinstance(frozen.line, WaveLine) or frozen.terms):
        found[RATES] = _RATES
    return found


def _coefficients(frozen: Frozen) -> Iterator[str]:
    yield "function c = injector_coefficients()"
    yield f"%INJECTOR_COEFFICIENTS Effective coefficients of {frozen.name}; written by observer-rt {__version__}."
    for each in effective_coefficients(frozen):
        yield f"c.{each.name} = {each.value!r}; % [{each.unit}] {each.meaning}"
    for name, matrix in (
        ("V", frozen.network.hidden),
        ("W", frozen.network.output),
        ("bias", frozen.network.bias.reshape(-1, 1)),
    ):
        yield f"c.{name} = {_matrix(matrix)};"
    yield "c.equations = { ..."
    for line in equations(frozen):
        quoted = line.replace("'", "''")
        yield f"    '{quoted}', ..."
    yield "    };"
    yield "end"


def _matrix(values: NDArray[np.float64]) -> str:
    return "[" + "; ".join(" ".join(repr(float(value)) for value in row) for row in values) + "]"
