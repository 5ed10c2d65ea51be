"""The network part of phi: N = W sigma(V z) + b, the relative changes of nozzle and seat flow.

z = [p_S - p_C, A_S, time since the needle opened, p_R] for the nozzle, [A_S, p_L - p_S] for the seat. A hidden neuron
is the tanh of the distance of one input, or of two inputs' mean, from a centre: they span how holes and seats are
known to depart from their laws, and other smooth departures. The layer is fixed, so that phi is linear in learned
weights; an unexcited neuron keeps its prior. Neurons along one direction add up to a curve of cubic pieces, so that
the integrator looks up one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from observer_rt.core.model import model
from observer_rt.foundation.units import Floats

OVERLAP = 0.7  # width of a neuron, in distances between their centres


class Group(NamedTuple):
    """Neurons of a curve: its flow and inputs, their standard deviation before any event, how many, their centres.

    The centres are from the first to the last: in p_0, A_0 and s, of two inputs as shares of their reach.
    """

    name: str
    prior: float
    neurons: int
    first: float
    last: float

    def basis(self, reach: float) -> Floats:
        """Cubics (PIECES, 4, neurons) of the neurons over an input from 0 to its reach, in pieces from 0 to 1."""
        centres, distance = np.linspace(self.first, self.last, self.neurons, retstep=True)
        scale, piece = 1.0 / (OVERLAP * distance), reach / model.PIECES
        value = np.tanh(scale * (np.linspace(0.0, reach, model.PIECES + 1)[:, None] - centres))
        slope = piece * scale * (1.0 - value**2)
        rise = np.diff(value, axis=0)
        bends = 3.0 * rise - 2.0 * slope[:-1] - slope[1:], slope[:-1] + slope[1:] - 2.0 * rise
        return np.stack((value[:-1], slope[:-1], *bends), axis=1)


def _pair(name: str) -> Group:
    return Group(name, 0.02, 4, 0.15, 0.75)


GROUPS = (  # in the order of the core's curves
    Group("nozzle_drop", 0.03, 11, 0.1, 1.7),
    Group("nozzle_area", 0.015, 6, 0.1, 1.25),
    Group("nozzle_time", 0.015, 6, 0.1e-3, 1.8e-3),
    Group("nozzle_rail", 0.015, 6, 0.5, 1.55),
    *map(_pair, ("nozzle_drop_time", "nozzle_drop_rail", "nozzle_rail_time")),
    *map(_pair, ("nozzle_area_drop", "nozzle_area_rail", "nozzle_area_time")),
    Group("seat_area", 0.02, 6, 0.1, 1.25),
    Group("seat_drop", 0.02, 5, 0.03, 0.9),
    _pair("seat_area_drop"),
)
_ALONG = np.array([model.inputs_along(curve) for curve in range(model.CURVES)])
IS_PAIR = _ALONG[:, 0] != _ALONG[:, 1]  # (CURVES,), of two inputs
OF_NOZZLE = sum(group.neurons for group in GROUPS[: model.FIRST_OF_SEAT])
HIDDEN = sum(group.neurons for group in GROUPS)  # q
NEURONS = np.array([group.neurons for group in GROUPS])
BASIS = np.zeros((model.CURVES, model.PIECES, 4, model.MOST_NEURONS))
for _curve, _group in enumerate(GROUPS):
    BASIS[_curve, :, :, : _group.neurons] = _group.basis(1.0 if IS_PAIR[_curve] else model.REACH[_ALONG[_curve, 0]])
_USED = np.arange(model.MOST_NEURONS) < NEURONS[:, None]
_PER_PIECE = 0.5 * model.PIECES / np.array(model.REACH)


class Network(NamedTuple):
    """The network of (7), and a rise of p_C: it changes the nozzle flow near p_S = p_C as no bounded network can."""

    curves: Floats  # (CURVES, PIECES, 4); (0, PIECES, 4) without hidden layer
    bias: Floats  # b (2,)
    nozzle: Floats  # (NOZZLE_NUMBERS,) rise of p_C [p_0] its law sees: while open, by u2 = A_S/A_0


def network_with(weights: Floats) -> Network:
    """The network with these weights (HIDDEN,) of its neurons, group by group; bias and rise of p_C are 0."""
    padded = np.zeros((model.CURVES, model.MOST_NEURONS, 1))
    padded[_USED, 0] = weights
    curves = BASIS.reshape(model.CURVES, -1, model.MOST_NEURONS) @ padded
    return Network(curves.reshape(model.CURVES, model.PIECES, 4), np.zeros(2), np.zeros(model.NOZZLE_NUMBERS))


def constant_network(nozzle: float = 0.0, seat: float = 0.0) -> Network:
    """A network without hidden neurons: flows change by the constant factors 1 + v_H and 1 + v_S of (27)."""
    return Network(np.zeros((0, model.PIECES, 4)), np.array([nozzle, seat]), np.zeros(model.NOZZLE_NUMBERS))


def activations(x: Sequence[float | Floats] | Floats, u: Sequence[float | Floats]) -> Floats:
    """Outputs (..., HIDDEN) of the neurons at states x (3, ...), inputs u = [p_R, A_S, time since the opening]."""
    inputs = np.stack(np.broadcast_arrays(x[2], u[1], u[2], u[0], x[0] - x[2]), axis=-1) * _PER_PIECE
    places = np.minimum(np.maximum(inputs[..., _ALONG].sum(axis=-1), 0.0), model.PIECES)
    pieces = np.minimum(places.astype(np.int64), model.PIECES - 1)
    cubics, t = BASIS[np.arange(model.CURVES), pieces], (places - pieces)[..., None]
    sigmas = cubics[..., 0, :] + t * (cubics[..., 1, :] + t * (cubics[..., 2, :] + t * cubics[..., 3, :]))
    return np.asarray(sigmas[..., _USED])
