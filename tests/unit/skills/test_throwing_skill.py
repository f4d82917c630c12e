"""The skill, from demonstrations that a session recorded to plans for baskets that nobody
demonstrated.
"""

import gc
import re
import weakref
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, CommanderSettings, check_plan, same_plan, the_arm
from dart_skill.common.flight import landing
from dart_skill.movement import azimuth_frame, azimuth_of, azimuth_target_frame
from dart_skill.recording import Demonstration
from dart_skill.skills.learning import (
    CONFIGURATIONS,
    DEFAULT,
    LADDER,
    LEAST_DEMONSTRATIONS,
    REACH_MARGIN,
    SIDE_MARGIN,
    ThrowSettings,
    Unreachable,
    choose_components,
    component_ellipsoids,
    configuration,
    credence_of,
    frames_for,
    learn_throwing,
    prepare,
)
from dart_skill.skills.observation import fit_release
from dart_skill.skills.protocol import load_skill
from tests.throw_demonstrations import changed_throw, parts_of, throw_demonstration

NEW_BASKETS = [(1.75, 0.0, 0.4), (2.05, 0.45, 0.4), (1.6, -0.4, 0.4), (1.9, 0.2, 0.55)]


@pytest.fixture(scope="module")
def skill(demonstrations):
    return learn_throwing(demonstrations)


@pytest.fixture(scope="module")
def new_plan(skill):
    return skill.plan(np.array(NEW_BASKETS[0]))


def turned(demonstration, angle):
    """The same throw in a world that is turned about its vertical axis: J1 turns with it."""
    turn = Rotation.from_euler("z", angle)
    joints = demonstration.joint_position.copy()
    joints[:, 0] += angle
    return changed_throw(
        demonstration,
        target=turn.apply(demonstration.target.copy()),
        hand_position=turn.apply(demonstration.hand_position.copy()),
        hand_quaternion=(
            turn * Rotation.from_quat(demonstration.hand_quaternion.copy())
        ).as_quat(),
        ball_position=turn.apply(demonstration.moved.position.copy()),
        joint_position=joints,
    )


def flown(plan):
    """Where the ball crosses the rim's plane if it leaves the planned path at the planned release:
    by finite differences.
    """
    grip = plan.path.position + Rotation.from_quat(plan.path.quaternion).apply(
        the_arm().hand.ball_centre
    )
    velocity = np.gradient(grip, plan.path.time, axis=0, edge_order=2)
    at_release = [
        np.array([np.interp(plan.release, plan.path.time, column) for column in values.T])
        for values in (grip, velocity)
    ]
    return landing(*at_release, plan.thrown.target[2]).position


# preparing


def test_the_release_is_found_where_the_simulator_let_go(taught, demonstrations):
    """Within 4 ms, although no sensor reports it."""
    for trial, demonstration in zip(taught, demonstrations, strict=True):
        truth = next(s.stamp_ns for s in trial.states if not s.ball_held) - 2_000_000
        prepared = prepare(demonstration, DEFAULT)
        found = demonstration.stamp_ns * 1e-9 + prepared.release.time
        assert found == pytest.approx(truth * 1e-9, abs=4e-3), (
            found - truth * 1e-9,
            prepared.release.time_uncertainty,
        )
        assert 0.015 < prepared.hand_delay < 0.045


def test_the_shared_instant_is_time_zero(demonstrations):
    by_release = prepare(demonstrations[0], DEFAULT)
    by_start = prepare(demonstrations[0], configuration("thesis"))
    assert by_release.release_time == 0.0 and by_release.start < -0.3 < 0.1 < by_release.stop
    assert by_start.start == 0.0 and by_start.release_time == pytest.approx(-by_release.start)
    assert by_release.motion.shape == by_release.attractor.shape == (len(by_release.time), 5)
    np.testing.assert_allclose(np.diff(by_release.time), 0.01, atol=1e-9)


def test_the_task_is_where_the_ball_landed_or_where_the_basket_stood(taught, demonstrations):
    for trial, demonstration in zip(taught, demonstrations, strict=True):
        np.testing.assert_allclose(
            prepare(demonstration, DEFAULT).task, trial.outcome.landing, atol=1e-3
        )
        np.testing.assert_array_equal(
            prepare(demonstration, configuration("thesis")).task, demonstration.target
        )


def scattered(demonstration, faster):
    """The throw with a ball that leaves the hand faster than it, by a share."""
    time, place = demonstration.moved.time, demonstration.moved.position
    release = prepare(demonstration, DEFAULT).release
    flown = np.maximum(time - release.time, 0.0)[:, None] * faster * release.velocity
    return changed_throw(demonstration, ball_position=place + flown)


def test_where_the_motion_leads_is_where_the_ball_lands_but_for_the_scatter(demonstrations):
    by_motion = changed_throw(DEFAULT, by_motion=True)
    for demonstration in demonstrations:
        led, seen = (prepare(demonstration, how).task for how in (by_motion, DEFAULT))
        assert np.linalg.norm(led - seen) < 0.08
        other = scattered(demonstration, 0.03)
        farther = np.linalg.norm(prepare(other, DEFAULT).task - seen)
        assert farther > 0.05
        assert np.linalg.norm(prepare(other, by_motion).task - led) < 0.7 * farther


def test_a_demonstration_that_cannot_be_used_is_named(demonstrations):
    blind = changed_throw(
        demonstrations[0], id="lost", ball_time=np.empty(0), ball_position=np.empty((0, 3))
    )
    with pytest.raises(ValueError, match="demonstration lost: "):
        learn_throwing([*demonstrations, blind])
    first = demonstrations[0]
    held = changed_throw(
        first,
        id="held",
        ball_position=np.tile(first.moved.position[0], (len(first.moved.time), 1)),
    )
    with pytest.raises(ValueError, match="demonstration held: no free flight"):
        learn_throwing([*demonstrations, held])


def test_a_demonstration_is_prepared_once_for_all_that_read_it_alike(demonstrations):
    """Kept are the numbers of a new preparation; what reads the demonstration otherwise gets its
    own.
    """
    one = replace(demonstrations[0])
    kept = prepare(one, DEFAULT)
    assert (
        prepare(
            one,
            replace(
                DEFAULT, name="other", components=3, width=0.2, step=0.002, frames=("azimuth",)
            ),
        )
        is kept
    )
    assert not any(
        value.flags.writeable for value in vars(kept).values() if isinstance(value, np.ndarray)
    )
    for part in ("time", "motion", "velocity", "attractor", "task", "start_pose", "start_posture"):
        np.testing.assert_array_equal(
            getattr(prepare(replace(one), DEFAULT), part), getattr(kept, part)
        )


@pytest.mark.parametrize(
    "changes",
    [
        {"frames": ("start", "target")},
        {"alignment": "start"},
        {"relabel": False},
        {"by_motion": True},
        {"stiffness": 150.0},
        {"orientation_stiffness": 150.0},
    ],
    ids=str,
)
def test_what_reads_a_demonstration_otherwise_prepares_it_anew(demonstrations, changes):
    other, kept = changed_throw(DEFAULT, **changes), prepare(demonstrations[0], DEFAULT)
    again, fresh = prepare(demonstrations[0], other), prepare(replace(demonstrations[0]), other)
    differing = []
    for part in ("time", "motion", "attractor", "task"):
        np.testing.assert_array_equal(getattr(again, part), getattr(fresh, part))
        differing.append(not np.array_equal(getattr(again, part), getattr(kept, part)))
    assert any(differing)


def test_what_was_prepared_goes_with_its_demonstration(demonstrations):
    one = replace(demonstrations[0])
    prepared, seen = weakref.ref(prepare(one, DEFAULT)), weakref.ref(one)
    del one
    gc.collect()
    assert seen() is None and prepared() is None


def test_task_frames_map_to_the_world(demonstrations):
    """A x + b of the first frame: identity but for the turn; the distance passes through
    untouched.
    """
    task, start = np.array([1.2, 1.6, 0.4]), np.array([-0.5, 0.1, 1.8])
    for name in (("base", "target"), ("start", "target"), ("azimuth",), ("azimuth", "target")):
        for with_distance in (False, True):
            frames = frames_for(
                task, start, replace(DEFAULT, frames=name, distance_input=with_distance)
            )
            size = 6 + with_distance
            assert len(frames) == (len(name))
            for frame in frames:
                assert frame.A.shape == (size, size) and frame.b.shape == (size,)
                assert abs(np.linalg.det(frame.A)) > 1e-9
            if with_distance:
                np.testing.assert_array_equal(frames[0].A[1], np.eye(size)[1])


def test_turned_frames_are_the_azimuth_frame_and_that_of_the_target():
    """As `movement` has them, without the distance."""
    task = np.array([1.2, 1.6, 0.4])
    for with_distance in (False, True):
        features = [0, *range(1 + with_distance, 6 + with_distance)]
        found = frames_for(
            task,
            np.zeros(3),
            replace(DEFAULT, frames=("azimuth", "target"), distance_input=with_distance),
        )
        for frame, expected in zip(
            found, (azimuth_frame(azimuth_of(task)), azimuth_target_frame(task)), strict=True
        ):
            np.testing.assert_array_equal(frame.A[np.ix_(features, features)], expected.A)
            np.testing.assert_array_equal(frame.b[features], expected.b)


# planning


@pytest.mark.parametrize("basket", NEW_BASKETS)
def test_a_plan_lands_on_a_basket_that_nobody_demonstrated(skill, basket):
    plan = skill.plan(np.array(basket))
    assert np.linalg.norm(plan.thrown.landing - basket) < 5e-3, plan.thrown.landing
    np.testing.assert_array_equal(plan.thrown.target, basket)


@pytest.mark.parametrize("basket", NEW_BASKETS)
def test_the_predicted_landing_is_that_of_the_planned_path(skill, basket):
    """Position, orientation and velocity of the path by finite differences: an error in a rate
    would show as centimetres.
    """
    plan = skill.plan(np.array(basket))
    np.testing.assert_allclose(flown(plan), plan.thrown.landing, atol=8e-3)


def test_velocity_and_acceleration_of_a_path_are_its_derivatives(new_plan):
    path = new_plan.path
    middle = slice(3, -3)
    np.testing.assert_allclose(
        np.gradient(path.position, path.time, axis=0)[middle], path.velocity[middle, :3], atol=0.03
    )
    np.testing.assert_allclose(
        np.gradient(path.velocity, path.time, axis=0)[middle], path.acceleration[middle], atol=1.0
    )
    rotation = Rotation.from_quat(path.quaternion)
    spin = (rotation[2:] * rotation[:-2].inv()).as_rotvec() / (path.time[2:] - path.time[:-2])[
        :, None
    ]
    np.testing.assert_allclose(spin[2:-2], path.velocity[3:-3, 3:], atol=0.05)


def test_the_path_is_what_the_attractor_makes_of_a_mass(new_plan):
    """(7.19): a = k (y - x) - d v at every instant."""
    path, gains = new_plan.path, new_plan.position_gains
    pull = (
        gains.stiffness * (new_plan.attractor_position - path.position)
        - gains.damping * path.velocity[:, :3]
    )
    np.testing.assert_allclose(
        pull[1:-1], path.acceleration[1:-1, :3], atol=0.02 * np.abs(path.acceleration[:, :3]).max()
    )
    assert gains.damping == pytest.approx(2 * np.sqrt(gains.stiffness))


def test_the_plan_looks_like_the_demonstrations(skill, new_plan):
    throws = skill.throws
    duration = np.mean([throw.stop - throw.start for throw in throws])
    assert new_plan.path.duration == pytest.approx(duration + 0.05, abs=0.1)
    heights = [throw.motion[:, 2].max() for throw in throws]
    assert min(heights) - 0.05 < new_plan.path.position[:, 2].max() < max(heights) + 0.05
    assert 0.0 < new_plan.open_hand < new_plan.release
    assert new_plan.release - new_plan.open_hand == pytest.approx(skill.hand_delay)


def test_the_commander_accepts_the_plan(new_plan):
    check_plan(new_plan, CommanderSettings.configured(), the_arm())
    position, _ = ArmModel().hand_pose(new_plan.start_posture)
    assert np.linalg.norm(position - new_plan.path.position[0]) < 0.02


def test_learning_and_planning_again_gives_the_same_plan_to_the_last_bit(
    demonstrations, skill, new_plan
):
    again = learn_throwing(demonstrations)
    again.plan(np.array(NEW_BASKETS[1]))
    assert same_plan(again.plan(np.array(NEW_BASKETS[0])), new_plan)
    assert again.model_id == skill.model_id == new_plan.model_id


def test_the_order_of_other_plans_does_not_matter(demonstrations):
    local = learn_throwing(demonstrations, configuration("weighted"))
    first = local.plan(np.array(NEW_BASKETS[0]))
    local.plan(np.array(NEW_BASKETS[1]))
    assert same_plan(local.plan(np.array(NEW_BASKETS[0])), first)


def test_a_task_far_from_every_demonstration_has_no_local_model(demonstrations):
    with pytest.raises(Unreachable, match="no demonstration is near enough for 'weighted'"):
        learn_throwing(demonstrations, configuration("weighted")).model_for(
            np.array([5.0, 0.0, 0.4])
        )


@pytest.mark.parametrize("angle", [0.5, -0.7])
@pytest.mark.parametrize(("name", "loose"), [("intervals", 1.0), ("default", 50.0)])
def test_turning_the_world_turns_the_plan(demonstrations, name, loose, angle):
    """With frames at the base's azimuth nothing depends on where north is, but for smoothing per
    axis: 0.1 mm.

    By so little EM comes to another of its optima, whose paths differ by up to 2 mm. Their landing
    is solved all the same.
    """
    turn, chosen = Rotation.from_euler("z", angle), configuration(name)
    first = learn_throwing(demonstrations, chosen).plan(np.array(NEW_BASKETS[0]))
    plan = learn_throwing([turned(d, angle) for d in demonstrations], chosen).plan(
        turn.apply(NEW_BASKETS[0])
    )
    for name in ("position", "velocity"):
        was, now = getattr(first.path, name), getattr(plan.path, name)
        expected = np.hstack([turn.apply(was[:, k : k + 3]) for k in range(0, was.shape[1], 3)])
        np.testing.assert_allclose(
            now, expected, atol=loose * (1e-4 if name == "position" else 2e-3), err_msg=name
        )
    np.testing.assert_allclose(
        plan.attractor_position, turn.apply(first.attractor_position), atol=loose * 1e-3
    )
    between = (turn * Rotation.from_quat(first.path.quaternion)).inv() * Rotation.from_quat(
        plan.path.quaternion
    )
    assert between.magnitude().max() < loose * 1e-3
    assert plan.start_posture[0] == pytest.approx(first.start_posture[0] + angle, abs=loose * 1e-4)
    np.testing.assert_allclose(plan.start_posture[1:], first.start_posture[1:], atol=loose * 1e-4)
    assert (plan.release, plan.open_hand) == pytest.approx(
        (first.release, first.open_hand), abs=loose * 1e-4
    )
    np.testing.assert_allclose(plan.thrown.landing, turn.apply(first.thrown.landing), atol=2e-3)


def test_another_demonstration_makes_another_model(demonstrations, skill):
    assert learn_throwing(demonstrations[:3]).model_id != skill.model_id
    assert learn_throwing(demonstrations, configuration("two_frames")).model_id != skill.model_id


def test_learning_uses_only_what_was_recorded(taught, demonstrations, new_plan):
    """Demonstrations hold stamps and poses of the cameras, encoders and the button. The
    simulator's own states are not among them: they are more exact than a camera could be, and
    thrown away here nothing changes.
    """
    allowed = {
        "id", "stamp_ns", "tracks", "situation", "events", "joint_time", "joint_position", "joint_velocity", "motion_start", "motion_stop",
        "frame_id", "joint_names", "skill",
    }  # fmt: skip
    assert {f.name for f in fields(Demonstration)} == allowed
    rebuilt = [throw_demonstration(**parts_of(one)) for one in demonstrations]
    assert same_plan(learn_throwing(rebuilt).plan(np.array(NEW_BASKETS[0])), new_plan)
    for trial, demonstration in zip(taught, demonstrations, strict=True):
        truth = {s.stamp_ns: s.ball_position for s in trial.states}
        stamps = [demonstration.stamp_ns + round(t * 1e9) for t in demonstration.moved.time]
        errors = np.array(
            [
                p - truth[s]
                for s, p in zip(stamps, demonstration.moved.position, strict=True)
                if s in truth
            ]
        )
        assert len(errors) > 50 and 5e-5 < np.std(errors) < 1e-3, (
            "the ball is seen with the cameras' noise, not as it is"
        )
        assert set(np.array(stamps) % 10_000_000) <= set(range(0, 10_000_000, 2_000_000)), (
            "at the cameras' frames"
        )


# refusals


def test_one_demonstration_is_too_few(demonstrations):
    with pytest.raises(
        ValueError, match=f"only 1 demonstration: record at least {LEAST_DEMONSTRATIONS}"
    ):
        learn_throwing(demonstrations[:1])
    with pytest.raises(ValueError, match="only 0 demonstrations"):
        learn_throwing([])


def test_two_demonstrations_are_enough_to_plan_between_them(demonstrations):
    plan = learn_throwing(demonstrations[:2]).plan(np.array([1.9, -0.3, 0.4]))
    assert np.linalg.norm(plan.thrown.landing - [1.9, -0.3, 0.4]) < 5e-3


def test_baskets_beyond_the_demonstrations_are_unreachable(skill):
    distances = np.array([throw.distance for throw in skill.throws])
    low, high = (1.0 - REACH_MARGIN) * distances.min(), (1.0 + REACH_MARGIN) * distances.max()
    message = (
        rf"is {{:.2f}} m from the base axis; the demonstrations reach from {low:.2f} to"
        rf" {high:.2f} m"
    )
    for distance in (high + 0.05, low - 0.05, 10.0):
        with pytest.raises(Unreachable, match=message.format(distance)):
            skill.plan(np.array([distance, 0.0, 0.4]))


@pytest.mark.parametrize("side", [-1, 1])
def test_baskets_beside_the_demonstrations_are_unreachable(skill, side):
    azimuths = np.array([throw.azimuth for throw in skill.throws])
    azimuth = (azimuths.max() if side > 0 else azimuths.min()) + side * (SIDE_MARGIN + 0.05)
    with pytest.raises(
        Unreachable, match=rf"at {np.rad2deg(azimuth):.0f} degrees; the demonstrations reach from"
    ):
        skill.plan(np.array([1.9 * np.cos(azimuth), 1.9 * np.sin(azimuth), 0.4]))


@pytest.mark.parametrize(
    "target", [[1.8, np.nan, 0.4], [1.8, 0.0], [[1.8, 0.0, 0.4]], [np.inf, 0.0, 0.4]]
)
def test_a_target_that_is_no_point_is_refused(skill, target):
    with pytest.raises(Unreachable, match="not three finite numbers: give the centre of the rim"):
        skill.plan(np.array(target))


def test_a_rim_above_the_flight_is_unreachable(skill):
    with pytest.raises(Unreachable, match="never comes down|no aim was found"):
        skill.plan(np.array([1.9, 0.0, 5.0]))


def test_the_width_is_the_one_that_predicts_left_out_demonstrations_best(demonstrations):
    skill = learn_throwing(demonstrations, configuration("cross_validated"))
    widths = skill.configuration.widths
    assert skill.width in widths
    errors = []
    for width in widths:
        squared = []
        for i, throw in enumerate(skill.throws):
            others = learn_throwing(
                [d for k, d in enumerate(demonstrations) if k != i],
                replace(configuration("weighted"), width=width),
            )
            try:
                squared.append(
                    np.sum((others.throw_for(throw.task).landing - throw.task)[:2] ** 2)
                )
            except Unreachable:
                squared.append(np.nan)
        errors.append(np.mean(squared))
    assert skill.width == widths[np.nanargmin(errors)], errors


def test_an_unknown_configuration_is_refused_with_the_names_there_are():
    with pytest.raises(
        ValueError,
        match=(
            "no configuration 'defualt': choose one of autonomous, cross_validated, default, em,"
            " intervals, shown_release, "
        ),
    ):
        configuration("defualt")
    assert configuration() is configuration("") is DEFAULT
    assert all(configuration(name).name == name for name in CONFIGURATIONS)


def test_the_ladder_leads_from_the_thesis_to_the_default_in_single_steps():
    whole = DEFAULT
    assert (whole.representation, whole.frames, whole.distance_input) == (
        "dsgmr",
        ("azimuth", "target"),
        True,
    ), "EM, frames, their product"
    rows = [configuration(name) for name in ("thesis", *LADDER) if not name.startswith("without")]

    def differing(one, other):
        return [
            row.name
            for row in fields(ThrowSettings)
            if row.name != "name" and getattr(one, row.name) != getattr(other, row.name)
        ]

    steps = [differing(*pair) for pair in pairwise(rows)]
    assert all(len(step) == 1 for step in steps) and not differing(rows[-1], whole)
    without = [
        differing(configuration(name), whole) for name in LADDER if name.startswith("without")
    ]
    assert without == steps


@pytest.mark.parametrize(
    ("field", "value"),
    [("frames", ("base",)), ("alignment", "end"), ("components", 0), ("stiffness", 0.0), ("step", 0.0), ("width", -1.0), ("nearest", -1),
     ("stiffness", np.nan), ("widths", (0.1, 0.0)), ("stiffness_range", (5.0,))],
)  # fmt: skip
def test_settings_that_make_no_sense_name_the_value(field, value):
    said = re.escape(", ".join(value) if field == "frames" else str(value))
    with pytest.raises(ValueError, match=f"{field}.*{said}"):
        ThrowSettings(**{field: value})


# configurations


@pytest.mark.parametrize("name", sorted(CONFIGURATIONS))
def test_every_named_configuration_learns_and_plans(demonstrations, name):
    plan = learn_throwing(demonstrations, configuration(name)).plan(np.array(NEW_BASKETS[0]))
    assert np.isfinite(plan.thrown.landing).all()
    assert plan.thrown.landing[2] == pytest.approx(0.4)
    speed = np.linalg.norm(plan.path.velocity[:, :3], axis=1).max()
    assert 1.0 < speed < 6.0
    assert 0.0 <= plan.open_hand < plan.release < plan.path.duration


def test_the_thesis_aims_at_the_basket_itself_and_misses_by_more(demonstrations, new_plan):
    """Figure 8.16 and chapter 9: its accuracy is poor; four demonstrations are few. The default
    solves for its aim.
    """
    plan = learn_throwing(demonstrations, configuration("thesis")).plan(np.array(NEW_BASKETS[0]))
    np.testing.assert_array_equal(plan.thrown.aim, plan.thrown.target)
    default_miss, thesis_miss = (
        np.linalg.norm(p.thrown.landing - p.thrown.target) for p in (new_plan, plan)
    )
    assert default_miss < 5e-3 < thesis_miss < 1.5, (default_miss, thesis_miss)


# what viewers show


def test_the_gaussians_of_a_plan_lie_where_its_attractor_goes(skill, new_plan):
    mixture = skill.mixture(np.array(NEW_BASKETS[0]))
    shapes = component_ellipsoids(mixture)
    assert len(shapes) == len(mixture.means_) == DEFAULT.components
    for centre, quaternion, size in shapes:
        nearest = np.linalg.norm(new_plan.attractor_position - centre, axis=1).min()
        assert nearest < 0.25, (centre, nearest)
        assert (
            np.linalg.norm(quaternion) == pytest.approx(1.0)
            and (size >= 0).all()
            and size.max() < 2.0
        )


def test_an_ellipsoid_is_the_covariance_of_the_positions(skill):
    mixture = skill.mixture(np.array(NEW_BASKETS[0]))
    columns = slice(mixture.means_.shape[1] - 5, mixture.means_.shape[1] - 2)
    for k, (centre, quaternion, size) in enumerate(component_ellipsoids(mixture, deviations=1.0)):
        rotation = Rotation.from_quat(quaternion).as_matrix()
        np.testing.assert_allclose(
            rotation @ np.diag((size / 2) ** 2) @ rotation.T,
            mixture.covariances_[k, columns, columns],
            atol=1e-9,
        )
        np.testing.assert_array_equal(centre, mixture.means_[k, columns])


def test_the_release_of_every_demonstration_is_consistent_with_its_flight(demonstrations):
    for d in demonstrations:
        grip = the_arm().hand.ball_centre
        release = fit_release(
            d.moved.time, d.moved.position, d.hand_time, d.hand_position, d.hand_quaternion, grip
        )
        assert release.grip_distance < 3e-3 and release.flight.residual < 1e-3


def test_a_movement_that_the_state_carries_releases_at_its_clock_and_lands_on_the_basket(
    demonstrations,
):
    """The autonomous policy (chapter 9) has no clock of its own: the plan's is set by the phase of
    the release.
    """
    basket = np.array([1.9, 0.1, 0.4])
    skill = learn_throwing(demonstrations, configuration("autonomous"))
    plan = skill.plan(basket)
    np.testing.assert_allclose(plan.thrown.landing, basket, atol=0.005)
    by_time = learn_throwing(demonstrations).plan(basket)
    at = [p.path.position[np.searchsorted(p.path.time, p.release)] for p in (plan, by_time)]
    assert np.linalg.norm(at[0] - at[1]) < 0.05, "it lets go where the movement in time does"


@pytest.mark.parametrize(("hidden", "off"), [(5, 1.0e-3), (10, 5.0e-3)])
@pytest.mark.parametrize("first", [-10, -6, -2, 2])
def test_a_hand_that_was_hidden_about_the_release_still_tells_when_it_was(
    demonstrations, first, hidden, off
):
    """Cameras lose a body for up to ten frames; one lost hand in a demonstration once stopped all
    learning.
    """
    for one in demonstrations:
        release = one.opened + prepare(one, DEFAULT).hand_delay
        start = int(np.searchsorted(one.hand_time, release)) + first
        seen = np.delete(np.arange(len(one.hand_time)), np.arange(start, start + hidden))
        parts = {
            name: getattr(one, name)[seen]
            for name in ("hand_time", "hand_position", "hand_quaternion")
        }
        delay = prepare(changed_throw(one, **parts), DEFAULT).hand_delay
        assert abs(one.opened + delay - release) < off


def test_a_hand_that_was_hidden_for_longer_is_named(demonstrations):
    one = demonstrations[0]
    seen = np.abs(one.hand_time - one.opened) > 0.2
    parts = {
        name: getattr(one, name)[seen]
        for name in ("hand_time", "hand_position", "hand_quaternion")
    }
    with pytest.raises(ValueError, match=f"{one.id}: the hand was hidden at the release"):
        prepare(changed_throw(one, **parts), DEFAULT)


@pytest.mark.parametrize("name", ["intervals", "two_frames", "without_inputs_once"])
def test_the_gaussians_in_the_world_are_the_product_of_those_of_the_frames(demonstrations, name):
    """(7.21): precisions add, and so do the means that they weigh."""
    skill, target = learn_throwing(demonstrations, configuration(name)), np.array(NEW_BASKETS[0])
    product, factors = skill.mixture(target), skill.frame_mixtures(target)
    assert len(factors) == {"intervals": 1, "two_frames": 2, "without_inputs_once": 2}[name]
    for k in range(product.n_components):
        precisions = [np.linalg.inv(factor.covariances_[k]) for factor in factors]
        covariance = np.linalg.inv(sum(precisions))
        mean = covariance @ sum(
            precision @ factor.means_[k]
            for precision, factor in zip(precisions, factors, strict=True)
        )
        np.testing.assert_allclose(covariance, product.covariances_[k], rtol=1e-5, atol=1e-12)
        np.testing.assert_allclose(mean, product.means_[k], rtol=1e-6)


def test_the_default_is_two_frames_whose_regressions_are_multiplied(demonstrations):
    """Time and distance count once: the responsibilities are those of one frame, and given these
    inputs (7.21) holds.
    """
    skill, target = learn_throwing(demonstrations), np.array(NEW_BASKETS[0])
    product, factors = skill.mixture(target), skill.frame_mixtures(target)
    assert len(factors) == 2
    for one in factors:
        np.testing.assert_allclose(product.means_[:, :2], one.means_[:, :2], atol=1e-9)
        np.testing.assert_allclose(
            product.covariances_[:, :2, :2], one.covariances_[:, :2, :2], rtol=1e-6, atol=1e-12
        )


def test_models_that_differ_in_the_product_have_other_names(demonstrations):
    kinds = (DEFAULT, replace(DEFAULT, inputs_once=False), replace(DEFAULT, overlap=0.5))
    assert len({learn_throwing(demonstrations, kind).model_id for kind in kinds}) == 3


def test_a_demonstration_that_was_seen_badly_counts_less(demonstrations):
    """One hand in 5 mm of noise: the others count in full."""
    rng = np.random.default_rng(3)
    first = demonstrations[0]
    poor = changed_throw(
        first,
        hand_position=first.hand_position + 0.005 * rng.standard_normal(first.hand_position.shape),
    )
    skill, clean = learn_throwing([poor, *demonstrations[1:]]), learn_throwing(demonstrations)
    assert (
        skill.credence[0] < 0.1
        and np.all(skill.credence[1:] == 1.0)
        and np.all(clean.credence == 1.0)
    )
    assert skill.release == pytest.approx(
        np.average([one.release_time for one in skill.throws], weights=skill.credence)
    )


@pytest.mark.parametrize(
    ("noise", "expected"),
    [
        ([1e-4, 2e-4, 5e-4], [1.0, 1.0, 1.0]),
        ([1e-4, 1e-4, 5e-3], [1.0, 1.0, 0.04]),
        ([2e-3, 2e-3, 4e-3], [1.0, 1.0, 0.25]),
        ([5e-3, 5e-3], [1.0, 1.0]),
    ],
)
def test_credence_is_the_inverse_of_the_variance_where_noise_is_large(noise, expected):
    """Below a millimetre it makes no difference, and cameras that are poor altogether make no
    demonstration poorer than the others.
    """
    np.testing.assert_allclose(credence_of(noise), expected)


# gains


def test_stiffness_from_the_demonstrations_holds_the_same_motion(demonstrations, new_plan):
    """Within its bounds, and pulled so by its attractors that (7.19) gives the accelerations of
    the path.
    """
    plan = learn_throwing(demonstrations, replace(DEFAULT, stiffness_range=(50.0, 800.0))).plan(
        np.array(NEW_BASKETS[0])
    )
    np.testing.assert_array_equal(plan.path.position, new_plan.path.position)
    gains = np.linalg.eigvalsh(plan.position_gains.stiffness)
    assert gains.min() > 49.9 and 100.0 < gains.max() < 800.1
    pull = np.einsum(
        "nij,nj->ni", plan.position_gains.stiffness, plan.attractor_position - plan.path.position
    )
    damped = np.einsum("nij,nj->ni", plan.position_gains.damping, plan.path.velocity[:, :3])
    np.testing.assert_allclose(pull - damped, plan.path.acceleration[:, :3], atol=1e-6)
    assert plan.orientation_gains == new_plan.orientation_gains


def test_position_and_orientation_have_gains_of_their_own(demonstrations):
    plan = learn_throwing(demonstrations, replace(DEFAULT, orientation_stiffness=400.0)).plan(
        np.array(NEW_BASKETS[0])
    )
    assert (plan.position_gains.stiffness, plan.orientation_gains.stiffness) == (200.0, 400.0)
    assert plan.orientation_gains.damping == pytest.approx(40.0)


@pytest.mark.parametrize(
    ("how", "why"),
    [
        ({"stiffness_range": (50.0,)}, "stiffness_range"),
        ({"stiffness_range": (800.0, 50.0)}, "stiffness_range"),
        ({"stiffness_range": (0.0, 50.0)}, "stiffness_range"),
        ({"orientation_stiffness": -1.0}, "orientation_stiffness"),
    ],
)
def test_gains_that_cannot_be_are_refused(how, why):
    with pytest.raises(ValueError, match=why):
        changed_throw(DEFAULT, **how)


def test_gains_are_part_of_the_name_of_a_model(demonstrations):
    kinds = (
        DEFAULT,
        replace(DEFAULT, stiffness_range=(50.0, 800.0)),
        replace(DEFAULT, orientation_stiffness=400.0),
    )
    assert len({learn_throwing(demonstrations, one).model_id for one in kinds}) == 3


@pytest.mark.parametrize("way", ["bic", "cross_validation"])
def test_the_number_of_components_is_chosen_on_request(demonstrations, way, monkeypatch):
    few = (3, 8, 16)
    monkeypatch.setattr("dart_skill.skills.learning._learning.COMPONENTS", few)
    skill = load_skill("throw")
    models = {
        number: learn_throwing(demonstrations, replace(DEFAULT, components=number))
        for number in few
    }
    score = {
        number: one.bic() if way == "bic" else one.left_out_error()
        for number, one in models.items()
    }
    chosen = choose_components(skill, demonstrations, way).settings
    assert chosen == replace(skill.settings, components=min(score, key=score.get))
    assert chosen.components != 3


def test_what_cannot_be_compared_is_said(demonstrations):
    skill = load_skill("throw")
    with pytest.raises(
        ValueError, match="'weighted' has a model for each target, and BIC compares nothing"
    ):
        choose_components(skill.named("weighted"), demonstrations, "bic")
    with pytest.raises(ValueError, match="only 2 demonstrations to leave out each once"):
        choose_components(skill, demonstrations[:2], "cross_validation")
