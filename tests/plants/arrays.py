"""The arrays that plants and benchmarks compute with."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
