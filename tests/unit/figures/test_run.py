"""The figures of a run: they say what the data say, to scale, and the same data give the same
bytes.
"""

import re
from dataclasses import replace
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest

from dart_skill.figures import (
    HandRecording,
    along_across,
    demonstrated_motions,
    executed_throw,
    execution_figure,
    frame_views,
    gaussians_figure,
    landings_figure,
    save,
    svg_text,
    synchronisation_figure,
)
from dart_skill.session import TrialResult
from dart_skill.skills.learning import configuration, learn_throwing

SVG = "{http://www.w3.org/2000/svg}"
MS = 1_000_000


class Drawing:
    """A figure as SVG, by what can be asked of it."""

    def __init__(self, figure):
        self.text = svg_text(figure)
        self.root = ElementTree.fromstring(self.text)
        self.texts = ["".join(element.itertext()) for element in self.root.iter(f"{SVG}text")]
        self.ids = [element.get("id") for element in self.root.iter() if element.get("id")]
        assert len(set(self.ids)) == len(self.ids), "every id once"

    def points(self, gid):
        """Number of markers of a series."""
        return len(list(self._group(gid).iter(f"{SVG}use")))

    def shapes(self, gid):
        """Number of lines or areas that are drawn as one; those that stand to be used more than
        once are counted where they are used.
        """
        kept = {
            id(path)
            for place in self._group(gid).iter(f"{SVG}defs")
            for path in place.iter(f"{SVG}path")
        }
        return sum(
            id(path) not in kept for path in self._group(gid).iter(f"{SVG}path")
        ) + self.points(gid)

    def count(self, pattern):
        """Number of groups whose id matches."""
        return sum(bool(re.fullmatch(pattern, one)) for one in self.ids)

    def box(self, gid):
        """Centre (2,) and size (2,) of the vertices of a path, in points."""
        path = next(self._group(gid).iter(f"{SVG}path")).get("d")
        vertices = np.array(re.findall(r"-?[\d.]+", path), dtype=float).reshape(-1, 2)
        return (vertices.min(0) + vertices.max(0)) / 2, np.ptp(vertices, axis=0)

    def marker(self, gid):
        """Place (2,) of the only marker of a series, in points."""
        use = next(self._group(gid).iter(f"{SVG}use"))
        return np.array([float(use.get("x")), float(use.get("y"))])

    def says(self, part):
        return any(part in text for text in self.texts)

    def _group(self, gid):
        return next(element for element in self.root.iter(f"{SVG}g") if element.get("id") == gid)


def twice(draw):
    """Draws twice; both must be equal byte for byte."""
    first, second = Drawing(draw()), Drawing(draw())
    assert first.text == second.text
    return first


def test_a_figure_is_written_as_svg_and_png(tmp_path):
    paths = save(landings_figure(THROWS, DEMONSTRATED), tmp_path / "new", "landings")
    assert [path.name for path in paths] == ["landings.svg", "landings.png"]
    assert paths[0].read_text().startswith("<?xml")
    assert paths[1].read_bytes().startswith(b"\x89PNG")


# the taught throws, as the simulator saw them


def recording_of_lesson(trial):
    states, nothing = trial.states[::5], np.empty(0, dtype=np.int64)
    stamps = np.array([state.stamp_ns for state in states])
    hand = np.array([state.hand_position for state in states])
    return HandRecording(
        stamps,
        hand,
        nothing,
        np.empty((0, 3)),
        basket=np.full(3, np.nan),
        command_stamps=nothing,
        opened_ns=None,
    )


@pytest.fixture(scope="module")
def recordings(taught):
    return [recording_of_lesson(trial) for trial in taught]


@pytest.fixture(scope="module")
def motions(recordings, demonstrations):
    return demonstrated_motions(recordings, demonstrations)


@pytest.fixture(scope="module")
def learned(demonstrations):
    """What configurations learn, by name; each learns once."""
    return cache(lambda name: learn_throwing(demonstrations, configuration(name)))


# synchronisation


def test_events_lie_on_the_clock_of_the_recording(motions, taught):
    for motion, trial in zip(motions, taught, strict=True):
        told = (
            trial.demonstration.stamp_ns - trial.states[0].stamp_ns
        ) * 1e-9 + trial.demonstration.opened
        assert motion.time[0] == 0.0
        assert (
            motion.first
            < motion.motion_start
            < told
            < motion.release
            < motion.motion_stop
            < motion.last
        )
        assert np.interp(motion.motion_start, motion.time, motion.speed) == pytest.approx(
            0.3, abs=0.03
        )
        assert motion.release - told == pytest.approx(0.03, abs=0.02), (
            "the hand takes 30 ms to open"
        )


@pytest.mark.slow
def test_synchronisation_shows_every_demonstration_twice(motions):
    drawing = twice(lambda: synchronisation_figure(motions))
    for when in ("before", "after"):
        assert drawing.count(rf"{when}_\d+_curve") == len(motions)
        assert sum(
            drawing.points(f"{when}_{k}_release") for k in range(1, len(motions) + 1)
        ) == len(motions)
    for label in (
        "speed of the hand [m/s]",
        "time since the release [s]",
        "start threshold, 0.3 m/s",
        "n = 4",
        "motion stops",
    ):
        assert drawing.says(label), drawing.texts


def test_releases_are_aligned_after_synchronisation_and_not_before(motions):
    drawing = Drawing(synchronisation_figure(motions))
    before, after = (
        [drawing.marker(f"{when}_{k}_release")[0] for k in range(1, len(motions) + 1)]
        for when in ("before", "after")
    )
    assert np.ptp(after) < 1e-3 and np.ptp(before) > 10.0, f"points: {before} {after}"


def test_one_demonstration_has_no_deviation(motions):
    drawing = Drawing(synchronisation_figure(motions[:1]))
    assert drawing.says("n = 1") and not drawing.says("±")


def test_synchronisation_without_demonstrations_is_refused():
    with pytest.raises(ValueError, match="no demonstrations"):
        synchronisation_figure([])


def test_a_demonstration_of_which_there_is_no_recording_is_named(recordings, demonstrations):
    stranger = replace(demonstrations[0], id="stranger", stamp_ns=10**15)
    with pytest.raises(ValueError, match="demonstration stranger"):
        demonstrated_motions(recordings, [stranger])


# gaussians


@pytest.mark.parametrize("name", ["default", "two_frames", "thesis"])
def test_the_components_seen_from_a_frame_have_the_moments_of_the_attractors_seen_from_it(
    demonstrations, learned, name
):
    """Whatever the responsibilities, an M step keeps the mean and the covariance of all samples."""
    skill = learned(name)
    shares = skill.model_for(demonstrations[0].target).mixture_.priors_
    for view in frame_views(skill):
        samples = np.concatenate(view.attractors)
        mean = shares @ view.means
        apart = view.means - mean
        covariance = np.einsum(
            "k,kij->ij", shares, view.covariances + apart[:, :, None] * apart[:, None, :]
        )
        np.testing.assert_allclose(
            mean,
            samples.mean(axis=0),
            atol=1e-4,
            err_msg=f"{view.name}; the rims' heights differ by 0.1 mm",
        )
        np.testing.assert_allclose(
            covariance, np.cov(samples.T, bias=True), atol=1e-5, err_msg=view.name
        )


def test_turned_frames_see_every_throw_straight_ahead(demonstrations, learned):
    base, target = frame_views(learned("default"))
    assert np.abs(base.releases[:, 1]).max() < 0.05 and np.abs(target.releases[:, 1]).max() < 0.05
    distances = base.releases[:, 0] - target.releases[:, 0]
    np.testing.assert_allclose(
        distances,
        [np.hypot(*d.target[:2]) for d in demonstrations],
        atol=0.2,
        err_msg="but for the misses",
    )


def test_without_the_distance_the_target_sees_the_components_for_the_median_task(learned):
    skill = learned("weighted")
    base, target = frame_views(skill)
    distance = sorted(throw.distance for throw in skill.throws)[len(skill.throws) // 2]
    shift = np.tile([distance, 0.0, 0.4], (len(base.means), 1))
    np.testing.assert_allclose(
        base.means - target.means,
        shift,
        atol=1e-3,
        err_msg="the cameras know the rim's height to 0.1 mm",
    )
    np.testing.assert_allclose(base.covariances, target.covariances, atol=1e-12)


def test_gaussians_shows_every_component_and_every_demonstration_in_four_panels(
    demonstrations, learned
):
    skill = learned("default")
    drawing = twice(lambda: gaussians_figure(skill))
    panels = [f"frame{frame}_{side}" for frame in (1, 2) for side in ("side", "above")]
    for panel in panels:
        assert (
            drawing.shapes(f"{panel}_components")
            == drawing.points(f"{panel}_means")
            == skill.configuration.components
        )
        assert (
            drawing.shapes(f"{panel}_attractors")
            == drawing.points(f"{panel}_releases")
            == len(demonstrations)
        )
    for label in (
        "Configuration 'default': 16 components as 2-sigma ellipses, n = 4 demonstrations",
        "up [m]",
        "left [m]",
    ):
        assert drawing.says(label), drawing.texts


@pytest.mark.parametrize("name", ["thesis", "thesis_local", "weighted"])
def test_gaussians_names_the_configuration(learned, name):
    assert Drawing(gaussians_figure(learned(name))).says(f"Configuration '{name}'")


# execution


def recording_of(plan, offset, start_ns=7_000 * MS, late=0.0):
    """What the cameras would see if the hand kept an offset (3,) from the plan; the controller
    runs at 500 Hz.
    """
    path = plan.path
    stamps = start_ns + np.arange(-100, 800) * 2 * MS
    due = (stamps - start_ns) * 1e-9 >= plan.open_hand - 1e-9
    hand_stamps = start_ns + np.arange(-20, 100) * 10 * MS
    place = [
        np.interp((hand_stamps - start_ns) * 1e-9 - late, path.time, column)
        for column in path.position.T
    ]
    ball = np.linspace([0.0, 0.0, 2.0], plan.thrown.target, len(hand_stamps))
    return HandRecording(
        hand_stamps,
        np.column_stack(place) + offset,
        hand_stamps,
        ball,
        plan.thrown.target,
        stamps,
        int(stamps[due][0]),
    )


@pytest.mark.parametrize("open_hand", [0.52, 0.5213])
def test_the_clock_of_the_plan_is_found_to_the_nanosecond(plan, open_hand):
    """The hand opens at the first command that is due, which may be up to one period late."""
    plan = plan.opening_at(open_hand)
    throw = executed_throw([recording_of(plan, np.zeros(3))], plan)
    np.testing.assert_allclose(throw.hand_time, np.arange(len(throw.hand_time)) * 0.01, atol=1e-12)
    assert np.abs(throw.tracking_error).max() < 1e-9


def test_the_tracking_error_tells_late_from_beside(plan):
    beside = executed_throw([recording_of(plan, np.array([0.0, 0.005, 0.0]))], plan).tracking_error
    np.testing.assert_allclose(beside, np.tile([0.0, 0.005], (len(beside), 1)), atol=1e-4)
    late = executed_throw([recording_of(plan, np.zeros(3), late=0.001)], plan)
    k = int(np.argmin(np.abs(late.hand_time - plan.release)))
    speed = np.linalg.norm(plan.path.velocity[np.searchsorted(plan.path.time, plan.release), :3])
    assert late.tracking_error[k] == pytest.approx([-0.001 * speed, 0.0], abs=1e-4)


def test_execution_shows_all_paths_and_states_the_error(plan):
    throw = executed_throw([recording_of(plan, np.array([0.0, 0.005, 0.0]))], plan)
    drawing = twice(lambda: execution_figure(throw))
    for gid in (
        "attractor",
        "planned",
        "hand",
        "ball",
        "basket",
        "predicted_landing",
        "error_total",
        "error_along",
        "error_beside",
    ):
        assert drawing.count(gid) == 1, gid
    assert drawing.points("ball") == len(throw.ball_time) > 0
    for label in (
        "hand, planned",
        "hand, seen",
        "height [m]",
        "hand seen minus planned [mm]",
        "5.0 mm at the",
        "at most 5.0 mm before it",
    ):
        assert drawing.says(label), drawing.texts


def test_the_basket_is_drawn_to_scale_from_the_side(plan):
    throw = executed_throw([recording_of(plan, np.zeros(3))], plan)
    drawing = Drawing(execution_figure(throw))
    _, size = drawing.box("basket")
    assert size[1] / size[0] == pytest.approx(0.35 / 0.30, rel=1e-3)


def test_a_throw_whose_ball_was_not_seen_is_drawn_without_it(plan):
    recording = replace(
        recording_of(plan, np.zeros(3)),
        ball_stamps=np.empty(0, dtype=np.int64),
        ball_position=np.empty((0, 3)),
    )
    drawing = Drawing(execution_figure(executed_throw([recording], plan)))
    assert drawing.count("ball") == 0 and not drawing.says("ball, seen")


def test_a_throw_that_is_not_in_the_bag_is_refused(plan):
    recording = recording_of(plan, np.zeros(3))
    for others in (
        [],
        [replace(recording, basket=plan.thrown.target + [0.1, 0.0, 0.0])],
        [replace(recording, opened_ns=None)],
    ):
        with pytest.raises(ValueError, match="no recording of a throw at a basket"):
            executed_throw(others, plan)


# landings


def at(distance, degrees, along=0.0, across=0.0, inside=True):
    """A throw at a basket in polar coordinates that lands so far beyond it and to the left of it."""
    forward = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
    target = distance * forward
    landing = target + along * forward + across * np.array([-forward[1], forward[0]])
    return TrialResult.of_throw(
        (*target, 0.4), (*landing, 0.4), float(np.hypot(along, across)), inside
    )


UNSEEN = TrialResult.of_throw((1.6, 0.2, 0.4), None, None, False)
THROWS = (
    at(1.7, 30, 0.02, -0.01),
    at(2.3, -40, 0.0, 0.01),
    at(2.0, 0, 0.25, inside=False),
    UNSEEN,
)
DEMONSTRATED = np.array([[1.5, 0.5, 0.4], [2.0, -1.0, 0.4], [2.2, 0.1, 0.4]])


def test_a_landing_is_measured_along_and_across_its_throw():
    assert along_across(at(1.8, 70, 0.03, -0.02)) == pytest.approx([0.03, -0.02])


def test_landings_shows_every_basket_and_every_landing_that_was_seen():
    drawing = twice(lambda: landings_figure(THROWS, DEMONSTRATED))
    assert (drawing.count(r"demonstrated_\d+"), drawing.count(r"thrown_\d+")) == (3, 4)
    for panel in ("plan", "relative"):
        assert (drawing.points(f"{panel}_in"), drawing.points(f"{panel}_out")) == (
            2,
            1,
        ), "one landing was not seen"
    for label in (
        "in 2/4, median 2.2 cm, 90 % 20.4 cm, landing seen 3/4",
        "radius of the rim 15 cm",
        "along the throw, + too far [cm]",
        "y [m]",
    ):
        assert drawing.says(label), drawing.texts


def test_baskets_are_drawn_to_scale():
    drawing = Drawing(landings_figure(THROWS, DEMONSTRATED))
    arm = drawing.marker("arm")
    for gid, distance in (
        ("thrown_1", 1.7),
        ("thrown_2", 2.3),
        ("demonstrated_2", np.hypot(2.0, 1.0)),
    ):
        centre, size = drawing.box(gid)
        assert size[0] == pytest.approx(size[1], rel=1e-4), gid
        assert np.linalg.norm(centre - arm) / size[0] == pytest.approx(
            distance / 0.30, rel=1e-4
        ), gid


def test_a_landing_too_far_and_to_the_left_is_drawn_above_and_left_of_the_centre():
    drawing = Drawing(landings_figure([at(2.0, 50, 0.05, 0.10)], DEMONSTRATED))
    centre, size = drawing.box("rim")
    place = (drawing.marker("relative_in") - centre) / size * 0.30
    assert place == pytest.approx([-0.10, -0.05], abs=1e-4), "in the SVG, y points down"


@pytest.mark.parametrize("throws", [(), (UNSEEN,)], ids=["no throws", "no landing was seen"])
def test_landings_without_a_landing_still_shows_the_baskets(throws):
    drawing = Drawing(landings_figure(throws, DEMONSTRATED))
    assert drawing.count(r"demonstrated_\d+") == 3 and drawing.count(r"thrown_\d+") == len(throws)
    assert drawing.says("landing seen 0/1" if throws else "no throws")


def test_landings_of_nothing_are_refused():
    with pytest.raises(ValueError, match="nothing to draw"):
        landings_figure((), np.empty((0, 3)))


def test_figures_leave_the_settings_of_matplotlib_alone():
    import matplotlib

    before = dict(matplotlib.rcParams)
    landings_figure(THROWS, DEMONSTRATED)
    assert dict(matplotlib.rcParams) == before
