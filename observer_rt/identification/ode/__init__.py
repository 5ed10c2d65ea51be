"""The search for missing laws in an ordinary differential equation of one's own."""

from observer_rt.identification.ode.findings import OdeFindings, find_terms
from observer_rt.identification.ode.laws import CandidateLaw
from observer_rt.identification.ode.library import common_laws
from observer_rt.identification.ode.model import OdeModel, OdeRecording

__all__ = ["CandidateLaw", "OdeFindings", "OdeModel", "OdeRecording", "common_laws", "find_terms"]
