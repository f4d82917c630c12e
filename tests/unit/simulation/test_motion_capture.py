"""The motion-capture model: who is seen, with what error, when, and the same again for the same
seed.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.configuration import node_parameters
from dart_skill.simulation import (
    BasketWalls,
    Camera,
    Frame,
    LatencyQueue,
    LinesOfSight,
    MotionCapture,
    MotionCaptureConfig,
    Sample,
)

FRAME_NS = 10_000_000
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
NO_CAPSULES = np.empty((0, 2, 3)), np.empty(0)
PARAMETERS = node_parameters("optitrack.yaml", "mock_optitrack")
QUIET = {**PARAMETERS, "dropout_rate": 0.0}


def scene(ball=(0.4, 0.1, 1.9)):
    return {
        "hand": (
            np.array([0.3, 0.1, 1.8]),
            Rotation.from_euler("xyz", [0.3, -1.0, 2.0]).as_quat(),
        ),
        "ball": (np.array(ball), IDENTITY),
        "basket": (np.array([2.0, 0.5, 0.6]), IDENTITY),
    }


def run(system, n_frames, episode=0, bodies=None, **occluders):
    bodies = scene() if bodies is None else bodies
    return [system.observe(i * FRAME_NS, episode, bodies, **occluders) for i in range(n_frames)]


def visible_cameras(system, points, capsules=NO_CAPSULES, basket=None):
    """How many cameras see each of the points (n, 3): integers (n,)."""
    cameras = system.config.cameras
    of_cameras = (
        np.array([getattr(camera, name) for camera in cameras])
        for name in ("position", "axes", "half_angles", "range")
    )
    view = LinesOfSight(*of_cameras, system.config.clearance)
    walls = basket and np.array([[*basket.rim, basket.radius, basket.depth]])
    ends, radii = (part[None] for part in capsules)
    return view.count(np.asarray(points)[None], ends, radii, walls, len(cameras))[0]


def in_front_of(camera, distance, right=0.0, down=0.0):
    return camera.position + distance * np.array([right, down, 1.0]) @ camera.axes


def test_the_configured_cameras_cover_the_arm_and_the_flights():
    system = MotionCapture(PARAMETERS, seed=0)
    assert len(system.config.cameras) == 12
    radius, azimuth, height = np.meshgrid(
        np.linspace(0.2, 2.75, 18), np.deg2rad(np.linspace(-60, 60, 17)), np.linspace(0.1, 2.5, 9)
    )
    points = np.stack(
        [radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1
    ).reshape(-1, 3)
    seen = visible_cameras(system, points)
    assert seen.min() >= 2, points[seen.argmin()]
    around = np.stack(
        np.meshgrid(*[np.linspace(-1, 1, 7)] * 2, np.linspace(0.8, 2.5, 7)), axis=-1
    ).reshape(-1, 3)
    seen = visible_cameras(system, around)
    assert seen.min() >= 4, around[seen.argmin()]


def test_field_of_view_is_a_pyramid_with_the_given_half_angles_and_range():
    camera = Camera([1.0, -2.0, 2.5], [0.0, 0.5, 1.0], (np.deg2rad(30), np.deg2rad(20)), range=5.0)
    system = MotionCapture(MotionCaptureConfig((camera,), min_cameras=1), seed=0)
    wide, tall = np.tan(np.deg2rad(30)), np.tan(np.deg2rad(20))
    expected = {
        (0.0, 0.0, 0.0): 0,
        (3.0, 0.99 * wide, 0.0): 1,
        (3.0, 1.01 * wide, 0.0): 0,
        (3.0, -0.99 * wide, 0.99 * tall): 1,
        (3.0, 0.0, 1.01 * tall): 0,
        (3.0, 0.0, -1.01 * tall): 0,
        (-3.0, 0.0, 0.0): 0,
        (4.99, 0.0, 0.0): 1,
        (5.01, 0.0, 0.0): 0,
    }
    points = np.array([in_front_of(camera, *place) for place in expected])
    np.testing.assert_array_equal(visible_cameras(system, points), list(expected.values()))
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
    assert camera.axes[1, 2] < 0.0, "the image's down axis points to the floor"


def hidden_by_sampling(start, end, ends, radii, clearance):
    """Independent check: march along the line of sight, smallest gap to any capsule."""
    length = np.linalg.norm(end - start)
    s = np.linspace(0.0, max(0.0, 1.0 - clearance / length), 4000)[:, None]
    points = start + s * (end - start)
    gap = np.inf
    for (a, b), radius in zip(ends, radii, strict=True):
        t = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0.0, 1.0)[:, None]
        gap = min(gap, np.min(np.linalg.norm(points - (a + t * (b - a)), axis=1)) - radius)
    return gap


def test_lines_of_sight_past_capsules_agree_with_marching_along_them():
    rng = np.random.default_rng(5)
    camera = Camera([0.0, -3.0, 1.0], [0.0, 0.0, 1.0], (1.4, 1.4))
    system = MotionCapture(MotionCaptureConfig((camera,), min_cameras=1), seed=0)
    outcomes = []
    for _ in range(300):
        ends = rng.normal(scale=0.5, size=(3, 2, 3)) + [0.0, -1.0, 1.0]
        ends[0, 1] = ends[0, 0]  # a sphere
        radii = rng.uniform(0.05, 0.3, size=3)
        point = rng.normal(scale=0.3, size=3) + [0.0, 0.2, 1.0]
        gap = hidden_by_sampling(camera.position, point, ends, radii, system.config.clearance)
        if abs(gap) < 1e-3:
            continue
        seen = visible_cameras(system, point[None], (ends, radii))[0]
        outcomes.append(seen)
        assert seen == (gap > 0.0), (gap, point, ends, radii)
    assert 50 < np.sum(outcomes) < len(outcomes) - 50, "the cases must contain both"


def test_a_holder_closer_than_the_clearance_does_not_hide_the_ball():
    camera = Camera([0.0, -3.0, 1.0], [0.0, 0.0, 1.0])
    system = MotionCapture(MotionCaptureConfig((camera,), min_cameras=1, clearance=0.1), seed=0)
    ball = np.array([[0.0, 0.0, 1.0]])
    for distance, seen in ((0.04, 1), (0.3, 0)):
        finger = np.array([[[-0.2, -distance, 1.0], [0.2, -distance, 1.0]]])
        assert visible_cameras(system, ball, (finger, np.array([0.02])))[0] == seen, distance


def test_a_body_needs_two_cameras():
    left, right = (
        Camera([-1.0, -3.0, 1.0], [0.0, 0.0, 1.0]),
        Camera([1.0, -3.0, 1.0], [0.0, 0.0, 1.0]),
    )
    shield = np.array([[[-0.4, -1.0, 0.0], [-0.4, -1.0, 2.0]]])
    bodies = {"ball": (np.array([0.0, 0.0, 1.0]), IDENTITY)}
    for min_cameras, capsules, seen in ((2, None, 1), (2, shield, 0), (1, shield, 1)):
        system = MotionCapture(
            MotionCaptureConfig((left, right), min_cameras=min_cameras, dropout_rate=0.0), seed=0
        )
        occluders = {} if capsules is None else {"capsules": (capsules, np.array([0.2]))}
        assert len(system.observe(0, 0, bodies, **occluders)) == seen


def test_inside_the_basket_only_cameras_that_look_in_from_above_see_the_ball():
    rim = np.array([2.0, 0.0, 0.6])
    basket = BasketWalls(rim, radius=0.15, depth=0.3)
    low = Camera([2.0, -3.0, 0.5], [2.0, 0.0, 0.5])
    slanted = Camera([2.0, -1.0, 1.6], [2.0, 0.0, 0.5])
    # on its line over the near edge
    over_the_edge = rim + [0.0, -0.15, 0.0] + 0.1 * np.array([0.0, 0.85, -1.0])
    above_rim, inside = rim + [0.0, 0.0, 0.05], rim - [0.0, 0.0, 0.05]
    higher, deeper = over_the_edge + [0.0, 0.0, 0.002], over_the_edge - [0.0, 0.0, 0.002]
    for camera, ball, seen in (
        (low, above_rim, 1),
        (low, inside, 0),
        (slanted, higher, 1),
        (slanted, deeper, 0),
    ):
        system = MotionCapture(MotionCaptureConfig((camera,), min_cameras=1), seed=0)
        assert visible_cameras(system, ball[None], basket=basket)[0] == seen, (camera, ball)
    above = MotionCapture(PARAMETERS, seed=0)
    depths = np.array([-0.1, 0.03, 0.1, 0.25])
    counts = visible_cameras(above, rim - np.outer(depths, [0.0, 0.0, 1.0]), basket=basket)
    assert (
        counts[0] >= counts[1] >= counts[2] >= counts[3] and counts[1] >= 2 and counts[3] == 0
    ), counts


def test_the_basket_hides_what_is_behind_it_but_not_its_own_rim():
    camera = Camera([0.0, -3.0, 0.5], [0.0, 0.0, 0.5])
    system = MotionCapture(MotionCaptureConfig((camera,), min_cameras=1), seed=0)
    basket = BasketWalls(np.array([0.0, 0.0, 0.6]), radius=0.15, depth=0.3)
    points = np.array([[0.0, 0.5, 0.5], [0.0, -0.5, 0.5], [0.0, 0.5, 0.9], [0.0, 0.5, 0.1]])
    np.testing.assert_array_equal(visible_cameras(system, points, basket=basket), [0, 1, 1, 1])
    assert visible_cameras(MotionCapture(PARAMETERS, 0), basket.rim[None], basket=basket)[0] >= 2


def test_noise_has_the_configured_size_and_the_calibration_error_stays():
    system = MotionCapture(QUIET, seed=3)
    frames = run(system, 2000)
    for index, name in enumerate(("hand", "ball", "basket")):
        true_position, true_quaternion = scene()[name]
        error = np.array([frame[index].position for frame in frames]) - true_position
        assert np.std(error, axis=0) == pytest.approx(1e-4, rel=0.1)
        assert np.linalg.norm(error.mean(axis=0)) == pytest.approx(2e-4, rel=0.1)
        attitude = Rotation.from_quat([frame[index].quaternion for frame in frames])
        tilt = (attitude * Rotation.from_quat(true_quaternion).inv()).as_rotvec()
        assert np.std(tilt, axis=0) == pytest.approx(1e-3, rel=0.1)
        assert np.abs(tilt.mean(axis=0)).max() < 1e-4


def test_the_calibration_error_turns_with_the_body_and_differs_between_runs():
    def offset(seed, attitude):
        bodies = {"ball": (np.array([0.4, 0.1, 1.9]), attitude.as_quat())}
        frames = run(MotionCapture({**QUIET, "noise": 0.0}, seed), 1, bodies=bodies)
        return frames[0][0].position - bodies["ball"][0]

    turned = Rotation.from_euler("xyz", [0.4, 1.0, -2.0])
    np.testing.assert_allclose(
        offset(1, turned), turned.apply(offset(1, Rotation.identity())), atol=1e-15
    )
    assert np.linalg.norm(offset(1, turned) - offset(2, turned)) > 1e-5


def same(a, b):
    return [
        (s.name, s.stamp_ns, s.publish_ns, *s.position, *s.quaternion)
        for frame in a
        for s in frame
    ] == [
        (s.name, s.stamp_ns, s.publish_ns, *s.position, *s.quaternion)
        for frame in b
        for s in frame
    ]


def test_same_seed_and_episode_give_the_same_samples_whatever_came_before():
    one, two = MotionCapture(PARAMETERS, seed=7), MotionCapture(PARAMETERS, seed=7)
    run(one, 37, episode=0)
    run(two, 5, episode=3)
    assert same(run(one, 100, episode=1), run(two, 100, episode=1))
    assert not same(run(one, 100, episode=2), run(two, 100, episode=1))
    assert not same(
        run(MotionCapture(PARAMETERS, seed=8), 100, 1),
        run(MotionCapture(PARAMETERS, seed=7), 100, 1),
    )


def moving_frames(n_frames, seed):
    """An arm that waves before the cameras, a ball that flies into a basket that somebody carries."""
    rng = np.random.default_rng(seed)
    for i in range(n_frames):
        s = i / n_frames
        rim = np.array([2.0, 0.5 - s, 0.6])
        bodies = {
            "hand": (
                np.array([0.3, 0.1, 1.8 - s]),
                Rotation.from_euler("xyz", [0.3, -1.0 + 2 * s, 2.0]).as_quat(),
            ),
            "ball": ((1 - s) * np.array([0.4, 0.1, 1.9]) + s * (rim - [0.0, 0.0, 0.2]), IDENTITY),
            "basket": (rim, IDENTITY),
        }
        capsules = (
            rng.normal([0.3, 0.0, 1.5], 0.3, size=(4, 2, 3)),
            rng.uniform(0.05, 0.2, size=4),
        )
        yield Frame(i * FRAME_NS, bodies, capsules, BasketWalls(rim, 0.15, 0.3))


def test_many_frames_at_once_are_the_frames_one_by_one_to_the_last_bit():
    parameters = {**PARAMETERS, "dropout_rate": 3.0}
    one_by_one, at_once = MotionCapture(parameters, seed=7), MotionCapture(parameters, seed=7)
    for episode in (1, 2):
        frames = list(moving_frames(150, seed=episode))
        single = [
            one_by_one.observe(f.stamp_ns, episode, f.bodies, f.capsules, f.basket) for f in frames
        ]
        parts = [
            at_once.observe_frames(episode, part)
            for part in (frames[:1], frames[1:60], frames[60:60], frames[60:])
        ]
        assert same(parts, single)
        counts = [
            sum(sample.name == name for frame in single for sample in frame)
            for name in ("hand", "ball", "basket")
        ]
        assert all(20 < count < 145 for count in counts), (
            f"{counts} of 150 frames: some must be lost, some seen"
        )


def test_a_frame_that_never_came_changes_nothing_in_those_after_it():
    parameters = {**PARAMETERS, "dropout_rate": 3.0}
    whole, torn = MotionCapture(parameters, seed=7), MotionCapture(parameters, seed=7)
    frames = [replace(frame, number=i) for i, frame in enumerate(moving_frames(150, seed=1))]
    came = [frame for frame in frames if frame.number % 7 != 3 and not 40 <= frame.number < 60]
    stamps = {frame.stamp_ns for frame in came}
    expected = [sample for sample in whole.observe_frames(1, frames) if sample.stamp_ns in stamps]
    assert same([torn.observe_frames(1, came[:30]), torn.observe_frames(1, came[30:])], [expected])
    with pytest.raises(ValueError, match="frame 149 of the episode comes after frame 149"):
        torn.observe_frames(1, came[-1:])
    torn.begin(1)
    assert same([torn.observe_frames(1, came)], [expected])


def test_frames_that_cannot_be_observed_at_once_are_refused():
    system = MotionCapture(PARAMETERS, seed=0)
    whole = next(moving_frames(1, seed=0))
    lone = {"ball": whole.bodies["ball"]}
    with pytest.raises(ValueError, match="different bodies"):
        system.observe_frames(0, [whole, Frame(0, lone, whole.capsules, whole.basket)])
    with pytest.raises(ValueError, match="with and without a basket"):
        system.observe_frames(0, [whole, Frame(0, whole.bodies, whole.capsules)])
    with pytest.raises(ValueError, match=r"capsules: .* got \(0, 2, 3\)"):
        system.observe_frames(0, [whole, Frame(0, whole.bodies, basket=whole.basket)])


def test_dropouts_last_one_to_ten_frames_at_the_configured_rate():
    system = MotionCapture({**PARAMETERS, "dropout_rate": 1.0}, seed=2)
    n_frames = 6_000
    bodies = {"ball": scene()["ball"]}
    seen = np.array([len(system.observe(i * FRAME_NS, 0, bodies)) for i in range(n_frames)])
    edges = np.flatnonzero(np.diff(np.concatenate([[1], seen, [1]])))
    lengths = np.diff(edges.reshape(-1, 2), axis=1)[:, 0]
    assert lengths.min() == 1 and 10 <= lengths.max() <= 25, (
        "longer ones are dropouts that overlap"
    )
    assert np.mean(lengths <= 10) > 0.95
    assert len(lengths) / (n_frames / 100.0) == pytest.approx(1.0, rel=0.3)


def test_latency_is_five_milliseconds_and_a_little_and_stamps_are_of_the_exposure():
    frames = run(MotionCapture(QUIET, seed=4), 1000)
    delay = np.array([(frame[0].publish_ns - frame[0].stamp_ns) * 1e-9 for frame in frames])
    assert delay.min() >= 5e-3 and np.mean(delay) == pytest.approx(5.4e-3, abs=1e-4)
    assert [frame[0].stamp_ns for frame in frames] == [i * FRAME_NS for i in range(1000)]
    assert all(len({sample.publish_ns for sample in frame}) == 1 for frame in frames), (
        "a frame is one packet"
    )


def test_the_queue_hands_out_each_sample_once_when_it_is_due():
    queue = LatencyQueue()
    early, late = (Sample("ball", 0, due, np.zeros(3), IDENTITY) for due in (5, 9))
    queue.push([late, early])
    assert queue.due(4) == []
    assert queue.due(5) == [early]
    queue.push([early])
    assert queue.due(20) == [early, late]
    assert queue.due(20) == []
    queue.push([early])
    queue.clear()
    assert queue.due(20) == []


def test_a_body_that_is_not_there_is_not_reported_and_takes_no_draws():
    with_ball, without = MotionCapture(QUIET, seed=1), MotionCapture(QUIET, seed=1)
    bodies = scene()
    lone = {name: bodies[name] for name in ("hand", "basket")}
    complete = [
        [sample for sample in frame if sample.name != "ball"] for frame in run(with_ball, 20)
    ]
    assert same(complete, run(without, 20, bodies=lone))
    assert without.observe(0, 0, {}) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"min_cameras": 13}, "min_cameras = 13"),
        ({"noise": -1.0}, "noise = -1"),
        ({"latency": float("nan")}, "latency = nan"),
        ({"dropout_frames": [5, 2]}, "dropout_frames"),
        ({"bodies": ["ball", "ball"]}, "each once"),
        ({"camera_names": ["c99"]}, "cameras.c99.position"),
        ({"half_angles_deg": [28.0, 95.0]}, "half_angles"),
    ],
)
def test_bad_configurations_are_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        MotionCapture({**PARAMETERS, **change}, seed=0)


def test_parameters_may_be_flat_as_ros_keeps_them():
    flat = {key: value for key, value in PARAMETERS.items() if key != "cameras"}
    for name, camera in PARAMETERS["cameras"].items():
        for key, value in camera.items():
            flat[f"cameras.{name}.{key}"] = value
    assert same(run(MotionCapture(flat, 5), 3), run(MotionCapture(PARAMETERS, 5), 3))


def test_bad_frames_are_refused_by_name():
    system = MotionCapture(PARAMETERS, seed=0)
    good = scene()
    with pytest.raises(ValueError, match="unknown body .*'cup'"):
        system.observe(0, 0, {"cup": good["ball"]})
    with pytest.raises(ValueError, match="position of ball must be a finite"):
        system.observe(0, 0, {"ball": (np.full(3, np.nan), IDENTITY)})
    with pytest.raises(ValueError, match="quaternion of ball has norm 2"):
        system.observe(0, 0, {"ball": (np.zeros(3), 2 * IDENTITY)})
    with pytest.raises(ValueError, match=r"end points \(c, 2, 3\)"):
        system.observe(0, 0, good, capsules=(np.zeros((1, 3)), np.ones(1)))
    with pytest.raises(ValueError, match="looks straight"):
        Camera([0.0, 0.0, 3.0], [0.0, 0.0, 0.0])


def clean(**faults):
    """A system without noise and dropouts, but with these faults."""
    return MotionCapture({**QUIET, "noise": 0.0, "calibration_error": 0.0, **faults}, seed=4)


def poses(system):
    return {one.name: one for one in system.observe(0, 0, scene())}


def test_the_ball_alone_has_a_noise_and_an_offset_of_its_own():
    system = clean(ball_noise=1e-3)
    samples = [one for frame in run(system, 300) for one in frame]
    spread = {
        name: np.std([one.position for one in samples if one.name == name], axis=0)
        for name in system.config.bodies
    }
    assert spread["ball"] == pytest.approx(1e-3, rel=0.2) and spread["hand"].max() < 1e-12
    off = {
        name: one.position - scene()[name][0]
        for name, one in poses(clean(ball_offset=3e-3)).items()
    }
    assert np.linalg.norm(off["ball"]) == pytest.approx(3e-3) and np.abs(off["hand"]).max() < 1e-12


def test_the_axes_of_the_hand_can_be_turned_and_nothing_else_is():
    seen = poses(clean(hand_turn=0.02))
    turn = Rotation.from_quat(scene()["hand"][1]).inv() * Rotation.from_quat(
        seen["hand"].quaternion
    )
    assert turn.magnitude() == pytest.approx(0.02)
    np.testing.assert_array_equal(seen["basket"].quaternion, IDENTITY)


def test_another_world_of_the_cameras_turns_and_shifts_all_bodies_alike():
    seen, true = poses(clean(registration_turn=0.01, registration_shift=0.005)), scene()
    turn = Rotation.from_quat(seen["basket"].quaternion)
    assert turn.magnitude() == pytest.approx(0.01)
    shifts = [one.position - turn.apply(true[name][0]) for name, one in seen.items()]
    np.testing.assert_allclose(shifts, np.tile(shifts[0], (3, 1)), atol=1e-12)
    assert np.linalg.norm(shifts[0]) == pytest.approx(0.005)


def test_stamps_of_receipt_are_late_and_messages_are_not():
    late, usual = poses(clean(stamp_delay=0.012))["hand"], poses(clean())["hand"]
    assert late.stamp_ns - usual.stamp_ns == 12_000_000 and late.publish_ns == usual.publish_ns


def test_a_frame_that_is_hours_away_asks_for_no_memory_and_changes_nothing():
    """The number comes with a message, and every frame before it would be drawn."""
    system, other = MotionCapture(PARAMETERS, seed=0), MotionCapture(PARAMETERS, seed=0)
    with pytest.raises(
        ValueError,
        match="frame 858993459 of the episode is 858993459 frames after .*: reset the world",
    ):
        system.observe(0, 0, scene(), number=858_993_459)
    seen, expected = system.observe(0, 0, scene()), other.observe(0, 0, scene())
    assert [one.position.tolist() for one in seen] == [one.position.tolist() for one in expected]
