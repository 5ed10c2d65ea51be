"""The arrays the benchmark computes with."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
