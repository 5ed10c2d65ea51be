"""The arrays that plants and benchmarks compute with."""

from observer_rt.foundation.units import Floats

Array = Floats
