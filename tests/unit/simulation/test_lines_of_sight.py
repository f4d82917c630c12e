"""Lines of sight as such; past arm and basket they are compared with marching in
test_motion_capture.py.
"""

import numpy as np

from dart_skill.simulation import BasketWalls, Camera, LinesOfSight

RIM = np.array([0.1, 0.2, 0.6])
BASKET = BasketWalls(RIM, radius=0.4, depth=0.5)
WALL = np.array([[*RIM, BASKET.radius, BASKET.depth]])


def looking(clearance=0.1, n_cameras=12):
    """Cameras in a circle that look at its middle."""
    angles = 2 * np.pi * np.arange(n_cameras) / n_cameras
    cameras = [
        Camera([3 * np.cos(a), 3 * np.sin(a), 0.4 + 0.2 * k], [0.0, 0.0, 0.5])
        for k, a in enumerate(angles)
    ]
    parts = (
        [getattr(one, name) for one in cameras]
        for name in ("position", "axes", "half_angles", "range")
    )
    return LinesOfSight(*(np.array(part) for part in parts), clearance)


def scene(n_frames=20, n_points=5, n_capsules=4):
    rng = np.random.default_rng(0)
    points = rng.normal([0.0, 0.0, 0.5], 0.5, size=(n_frames, n_points, 3))
    ends = rng.normal([0.0, 0.0, 0.5], 0.8, size=(n_frames, n_capsules, 2, 3))
    walls = np.tile(WALL, (n_frames, 1)) + rng.normal(0.0, 0.05, size=(n_frames, 5))
    return points, ends, rng.uniform(0.05, 0.2, size=(n_frames, n_capsules)), walls


def test_counting_ends_when_enough_cameras_see_a_point():
    view, arguments = looking(), scene()
    complete = view.count(*arguments, 12)
    assert complete.min() < 2 and complete.max() > 5
    for enough in (1, 2, 5):
        np.testing.assert_array_equal(view.count(*arguments, enough), np.minimum(complete, enough))


def test_a_frame_does_not_depend_on_those_beside_it():
    view, arguments = looking(), scene()
    complete = view.count(*arguments, 12)
    for f in (0, 7, 19):
        np.testing.assert_array_equal(
            view.count(*(part[f : f + 1] for part in arguments), 12)[0], complete[f]
        )


def test_the_wall_of_a_basket_hides_as_marching_along_the_line_says():
    """A step along a line of sight that leads from one side of the cylinder to the other, between
    rim and floor, is a crossing.
    """
    (start, forward), rng = (
        ((camera := Camera([0.0, -3.0, 1.2], [0.0, 0.0, 0.5])).position, camera.axes),
        np.random.default_rng(1),
    )
    view = LinesOfSight(start[None], forward[None], np.array([[1.4, 1.4]]), np.array([12.0]), 0.1)
    seen = []
    for point in rng.normal([0.1, 0.3, 0.3], 0.4, size=(300, 3)):
        line = start + np.linspace(0.0, 1.0, 20_000)[:, None] * (point - start)
        inside = np.hypot(*(line[:, :2] - RIM[:2]).T) < BASKET.radius
        crossing = np.flatnonzero(np.diff(inside.astype(int)))
        height = line[crossing, 2]
        hidden = ((height < RIM[2]) & (height > RIM[2] - BASKET.depth)).any()
        seen.append(
            view.count(point[None, None], np.empty((1, 0, 2, 3)), np.empty((1, 0)), WALL, 1)[0, 0]
        )
        near = np.abs(
            np.concatenate([height - RIM[2], height - RIM[2] + BASKET.depth, [1.0]])
        ).min()
        assert seen[-1] == (not hidden) or near < 1e-3, (point, height)
    assert 50 < sum(seen) < 250, "the cases must contain both"
