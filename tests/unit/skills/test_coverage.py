"""The most crowded of points that come and go is that of all distances."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dart_skill.skills.learning import Coverage

PLACES = st.tuples(*[st.integers(-3, 3)] * 3)


def crowded_of(points):
    """Index of the older of the nearest two, the first such pair, from the table of all distances."""
    apart = np.linalg.norm(np.array(points)[:, None] - np.array(points), axis=2)
    apart[np.tril_indices(len(points))] = np.inf
    return int(np.unravel_index(np.argmin(apart), apart.shape)[0])


@given(st.lists(PLACES, max_size=5), st.lists(PLACES | st.integers(0, 30), max_size=40))
def test_what_is_the_most_crowded_is_known_after_any_change(first, changes):
    """A place comes, or the point with a number goes. Many are at the same place, and many equally
    far apart.
    """
    points = [np.array(place, dtype=float) for place in first]
    crowd = Coverage(np.array(points).reshape(-1, 3))
    for change in changes:
        if isinstance(change, tuple):
            crowd.add(np.array(change, dtype=float))
            points.append(np.array(change, dtype=float))
        elif points:
            crowd.remove(change % len(points))
            del points[change % len(points)]
        assert len(crowd) == len(points)
        assert len(points) < 2 or crowd.most_crowded() == crowded_of(points)
