"""Types of arrays, each with one meaning; shapes and units are given where an array is described."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""geometry, motion, statistics"""
Complex = NDArray[np.complex128]
"""positions and directions in the plane, x + iy"""
Floats = NDArray[np.float32]
"""inputs and outputs of neural networks"""
Index = NDArray[np.int64]
"""row numbers"""
Flags = NDArray[np.bool_]
Arrays = dict[str, NDArray]
"""arrays by name, as a file of weights holds them"""
