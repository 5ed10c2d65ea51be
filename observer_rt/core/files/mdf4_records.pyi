"""Records of an unsorted MDF 4 data group: kind and place of each."""

import numpy as np
from numpy.typing import NDArray

LENGTH_SIZE: int
UNKNOWN_ID: int
VARIABLE: int

def walk(
    data: NDArray[np.uint8],
    position: int,
    id_size: int,
    ids: NDArray[np.uint64],
    lengths: NDArray[np.int64],
    kind_of: NDArray[np.int64],
    place_of: NDArray[np.int64],
) -> tuple[int, int, int]: ...
def numbers_at(data: NDArray[np.uint8], places: NDArray[np.int64], size: int) -> NDArray[np.uint64]: ...
