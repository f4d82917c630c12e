"""Points of a dart board in the world."""

import numpy as np


def in_world(face, board):
    """Points (..., 3) [m] in the world of points (..., 2) [mm] of a board, to the right and up
    from the bull: the inverse of `on_board`.
    """
    return face.beside_bull(1e-3 * np.asarray(board, dtype=float))
