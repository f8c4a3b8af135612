"""Counts pixels of a picture."""

import numpy as np


def count(picture, colour, tolerance=12):
    """Pixels of about that colour in a picture (an image or an array (H, W, 3))."""
    found = np.abs(np.asarray(picture).astype(int)[..., :3] - colour[:3]) <= tolerance
    return int(np.sum(np.all(found, axis=-1)))
