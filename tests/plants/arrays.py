"""Arrays of the plants. Imports nothing of `observer_rt`."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
