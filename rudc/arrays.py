"""Types of arrays, one meaning each; shapes and units stand where an array is described."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""geometry, motion, statistics"""
Complex = NDArray[np.complex128]
"""places and directions in the plane, x + iy"""
Floats = NDArray[np.float32]
"""what neural networks take and give"""
Index = NDArray[np.int64]
"""numbers of rows"""
Flags = NDArray[np.bool_]
Arrays = dict[str, NDArray]
"""arrays by name, as a file of weights holds them"""
