"""Darts by the arm: the board's plane, darts that stick in it, a skill that hits where it aims,
and what practice makes of it.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dart_skill.arm import Command, Grip
from dart_skill.cli import main
from dart_skill.common.flight import DART, TENNIS_BALL, crossing, flight, landing
from dart_skill.common.surface import BASKETS, BOARD_DIAMETER, RIMS, BoardFace, game_at
from dart_skill.darts import as_target, best_aim, score
from dart_skill.experiments.studies.arm_darts import (
    allowed_score,
    darts_session,
    run,
    table_of_seeds,
    teach,
)
from dart_skill.figures import arm_darts_figure, running, svg_text
from dart_skill.session import Dart, DartsRun
from dart_skill.simulation import Board, Teacher
from dart_skill.skills.darts import Darts
from dart_skill.skills.learning import (
    Unreachable,
    landing_if_late,
    learn_throwing,
    load_model,
    save_model,
)
from dart_skill.skills.observation import judge_flight
from dart_skill.skills.practice import PractisingSkill
from tests.unit.board_points import in_world

BOARD = Board()
FACE = BOARD.face
DARTS = Darts.configured()
CONFIGURATION = DARTS.settings
ASIDE = BoardFace((1.2, -1.9, 1.5))
"""A board that is not straight ahead."""
VACUUM = replace(TENNIS_BALL, drag_coefficient=0.0)


def throws_at(face, n, seed=0):
    """Positions and velocities (n, 3) of flights from near the base axis towards a board."""
    rng = np.random.default_rng(seed)
    position = np.column_stack([rng.uniform(-0.3, 0.3, (n, 2)), rng.uniform(1.8, 2.2, n)])
    ahead = face.normal * rng.uniform(3.0, 6.0, (n, 1))
    return position, ahead + face.axes[:, 1] * rng.uniform(-0.3, 0.3, (n, 1)) + [
        0.0,
        0.0,
        1.0,
    ] * rng.uniform(-1.0, 2.0, (n, 1))


# where a flight meets a vertical plane


@pytest.mark.parametrize("face", [FACE, ASIDE])
def test_in_vacuum_a_flight_meets_the_plane_where_the_parabola_does(face):
    position, velocity = throws_at(face, 50)
    meets = crossing(position, velocity, face.normal, face.distance, VACUUM)
    time = (face.distance - position @ face.normal) / (velocity @ face.normal)
    np.testing.assert_allclose(meets.time, time, atol=1e-9)
    np.testing.assert_allclose(
        meets.position,
        position + time[:, None] * velocity - np.outer(time**2, [0, 0, 0.5 * 9.81]),
        atol=1e-9,
    )
    np.testing.assert_allclose(meets.velocity, velocity - np.outer(time, [0, 0, 9.81]), atol=1e-9)


@pytest.mark.parametrize("projectile", [DART, TENNIS_BALL])
def test_with_drag_a_flight_meets_the_plane_where_an_independent_integration_does(projectile):
    position, velocity = throws_at(FACE, 4, seed=1)
    meets = crossing(position, velocity, FACE.normal, FACE.distance, projectile)

    def rates(_, state):
        v = state[3:]
        return np.concatenate([v, -projectile.drag * np.linalg.norm(v) * v - [0.0, 0.0, 9.81]])

    def reached(_, state):
        return state[0] - FACE.distance

    reached.terminal = True
    for k in range(4):
        end = solve_ivp(
            rates, (0.0, 3.0), [*position[k], *velocity[k]], events=reached, rtol=1e-10, atol=1e-12
        )
        np.testing.assert_allclose(meets.position[k], end.y_events[0][0][:3], atol=2e-6)
        assert meets.time[k] == pytest.approx(end.t_events[0][0], abs=1e-6)


def test_a_flight_away_from_the_plane_or_beyond_it_never_meets_it():
    position, velocity = (
        np.array([[0.0, 0, 2], [3.0, 0, 2], [0.0, 0, 2]]),
        np.array([[-3.0, 0, 1], [3.0, 0, 1], [0.0, 3, 1]]),
    )
    assert np.isnan(crossing(position, velocity, FACE.normal, FACE.distance).position).all()


@pytest.mark.parametrize(
    "normal", [[0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [1.0, 0.0]]
)
def test_a_plane_that_is_not_vertical_is_refused(normal):
    with pytest.raises(ValueError, match="horizontal unit vector"):
        crossing(np.zeros(3), np.ones(3), np.array(normal), 1.0)


def test_a_dart_loses_a_seventh_of_the_speed_that_a_ball_loses():
    assert 5.0 < TENNIS_BALL.drag / DART.drag < 9.0
    slow = [
        flight(np.zeros(3), np.array([4.0, 0, 0]), [0.5], ball)[1][0, 0]
        for ball in (DART, TENNIS_BALL)
    ]
    assert 4.0 - slow[0] == pytest.approx(4.0 - 4.0 / (1.0 + DART.drag * 4.0 * 0.5), rel=0.3), slow
    assert slow[1] < slow[0] < 4.0


# the surface of a board


@pytest.mark.parametrize("face", [FACE, ASIDE])
def test_points_of_the_board_are_where_the_thrower_sees_them(face):
    board = np.random.default_rng(2).uniform(-200, 200, (20, 2))
    world = in_world(face, board)
    np.testing.assert_allclose(face.on_board(world), board, atol=1e-9)
    np.testing.assert_allclose(world @ face.normal, face.distance)
    right = np.cross(face.normal, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(
        world, np.array(face.bull) + 1e-3 * (board[:, :1] * right + board[:, 1:] * [0.0, 0.0, 1.0])
    )


def test_darts_find_the_beds_that_have_their_names():
    assert score(FACE.on_board(np.array(FACE.bull) + [0.0, 0.0, 0.103])) == 60
    assert score(FACE.on_board(np.array(FACE.bull) + [0.0, -0.103, 0.0])) == 18, (
        "right of the bull, as the arm sees it, is the 6"
    )


@pytest.mark.parametrize("face", [FACE, ASIDE])
def test_coordinates_of_the_board_are_height_and_azimuth(face):
    for board in np.random.default_rng(3).uniform(-200, 200, (10, 2)):
        point = in_world(face, board)
        height, azimuth = face.coordinates(point)
        assert (height, azimuth) == pytest.approx((point[2], np.arctan2(point[1], point[0])))
        np.testing.assert_allclose(
            face.point(np.array([height, azimuth]), point), point, atol=1e-12
        )


@pytest.mark.parametrize(
    ("surface", "at"),
    [
        (RIMS, [1.6, 0.9, 0.4]),
        (FACE, in_world(FACE, [30.0, 50.0])),
        (ASIDE, in_world(ASIDE, [30, 50])),
    ],
)
def test_misses_are_farther_or_higher_and_to_the_left(surface, at):
    at = np.array(at)
    moved = at + surface.offset(np.array([0.03, -0.02]), at)
    np.testing.assert_allclose(surface.miss(moved - at, at), [0.03, -0.02], atol=1e-12)
    assert surface.apart(moved, at) == pytest.approx(np.hypot(0.03, 0.02))
    reach, azimuth = surface.coordinates(moved) - surface.coordinates(at)
    assert reach == pytest.approx(0.03, abs=1e-3) and azimuth < 0.0
    assert surface.seen_from(
        at, surface.coordinates(at), np.array([0.03, -0.02])
    ) == pytest.approx((0.03, -0.02))


def test_what_is_thrown_at_what_follows_from_the_board():
    assert game_at() is BASKETS and game_at(BOARD.position).projectile is DART
    with pytest.raises(ValueError, match="bull .* three finite numbers"):
        game_at((1.0, np.nan, 1.7))


# darts that stick


def freed(plant):
    """The plant's dart, out of the hand."""
    while plant.state.ball_held:
        plant.step(Command(plant.state_stamp_ns, grip=Grip.OPEN))


def launch(plant, position, velocity):
    world, half_a_step_earlier = plant._world, np.array(velocity) + [0.0, 0.0, 0.5 * 0.002 * 9.81]
    world.resetBasePositionAndOrientation(plant._ball, list(position), [0, 0, 0, 1])
    world.resetBaseVelocity(plant._ball, half_a_step_earlier.tolist(), [0, 0, 0])
    plant._observe()


def fly(plant, steps=500):
    states = [plant.state]
    for _ in range(steps):
        plant.step(Command(plant.state_stamp_ns))
        states.append(plant.state)
    return states


@pytest.mark.parametrize("board", [BOARD, Board(ASIDE.bull)])
def test_a_dart_sticks_where_its_flight_meets_the_board(make_plant, board):
    plant, face = make_plant(board=board), board.face
    for aim in ([0.0, 0.0], [-150.0, 80.0]):
        plant.reset()
        freed(plant)
        position, target = np.array([0.3, 0.0, 2.4]), in_world(face, aim)
        time = 0.45
        velocity = (target - position) / time + [0.0, 0.0, 0.5 * 9.81 * time]
        launch(plant, position, velocity)
        expected = crossing(position, velocity, face.normal, face.distance, DART)
        states = fly(plant)
        stuck = next(state for state in states if state.ball_in_basket)
        np.testing.assert_allclose(stuck.ball_position, expected.position, atol=2e-4)
        assert (stuck.stamp_ns - states[0].stamp_ns) * 1e-9 == pytest.approx(
            expected.time, abs=2.1e-3
        )
        np.testing.assert_array_equal(states[-1].ball_position, stuck.ball_position)
        np.testing.assert_array_equal(states[-1].ball_velocity, np.zeros(3))


def test_a_dart_beside_the_board_falls_on(make_plant):
    plant = make_plant(board=BOARD)
    freed(plant)
    past = np.array(FACE.bull) + [-0.3, 0.5 * BOARD_DIAMETER + 0.02, 0.1]
    launch(plant, past, [3.0, 0.0, 0.0])
    states = fly(plant, 600)
    assert not any(state.ball_in_basket for state in states)
    assert states[-1].ball_position[0] > FACE.distance + 0.5 and states[-1].ball_position[2] < 0.1


def test_a_dart_from_behind_does_not_stick_in_the_face():
    behind, before = np.array(FACE.bull) + [0.01, 0, 0], np.array(FACE.bull) - [0.03, 0, 0]
    assert BOARD.hit(behind, before) is None
    np.testing.assert_allclose(BOARD.hit(before, behind), FACE.bull, atol=1e-12)


def test_the_board_stays_where_it_hangs(make_plant):
    plant = make_plant(board=BOARD)
    np.testing.assert_array_equal(plant.reset(np.array([1.0, 1.0, 1.0])).basket, BOARD.position)
    with pytest.raises(ValueError, match="no basket to place"):
        plant.place_basket(np.ones(3))
    with pytest.raises(ValueError, match="make a new one"):
        plant.change(replace(plant.settings, board=None))


def test_rods_as_large_as_the_board_hide_what_is_behind_it():
    ends, radii = BOARD.capsules
    across = FACE.on_board(ends)
    assert across[..., 0].max() + 1e3 * radii[0] == pytest.approx(500 * BOARD_DIAMETER, rel=0.1)
    assert np.abs(across[..., 1]).max() + 1e3 * radii[0] == pytest.approx(
        500 * BOARD_DIAMETER, rel=0.01
    )
    assert (ends @ FACE.normal - radii[:, None] >= FACE.distance - 1e-9).all(), (
        "nothing in front of the face"
    )


# what is seen of a dart


def test_the_outcome_is_where_the_seen_flight_meets_the_board():
    rng, time = np.random.default_rng(4), np.arange(0.0, 0.9, 0.01)
    position, velocity = np.array([0.1, 0.02, 2.1]), np.array([4.2, -0.1, 1.6])
    meets = crossing(position, velocity, FACE.normal, FACE.distance, DART)
    path = np.where(
        (time < meets.time)[:, None], flight(position, velocity, time, DART)[0], meets.position
    )
    seen = path + 1e-4 * rng.standard_normal(path.shape)
    target = in_world(FACE, [0.0, 0.0])
    outcome = judge_flight(time, seen, target, 0.15, DART, surface=FACE)
    np.testing.assert_allclose(outcome.landing, meets.position, atol=3e-4)
    assert outcome.landing_error == pytest.approx(
        np.linalg.norm(meets.position - target), abs=3e-4
    )
    assert outcome.in_basket == FACE.holds(meets.position)


def test_the_teacher_aims_at_heights_of_the_board():
    teacher = Teacher(game=game_at(BOARD.position))
    for point in ([0.0, 0.0], [150.0, -100.0]):
        target = in_world(FACE, point)
        position, velocity = teacher._ball_at_release(teacher._speed_for(target[2], target))
        assert FACE.reached(position, velocity, target, DART) == pytest.approx(target[2], abs=2e-3)
    with pytest.raises(
        ValueError, match="target at 4.00 m above the floor is out of the teacher's reach"
    ):
        teacher.check(np.array([2.37, 0.0, 4.0]))


# the arm


@pytest.fixture(scope="module")
def arm():
    """A session with a board, the demonstrations of four darts that hit it, and the skill that
    they teach.
    """
    session = darts_session(seed=1)
    shown, _ = teach(
        session,
        DARTS,
        [
            DARTS.aimed(point)
            for point in ([0.0, 60.0], [-80.0, -60.0], [70.0, 0.0], [20.0, -120.0])
        ],
    )
    yield session, shown, learn_throwing(shown, CONFIGURATION)
    session.close()


@pytest.mark.slow
@pytest.mark.parametrize("bed", ["DB", "T20", "T11"])
def test_after_four_demonstrations_a_dart_hits_near_its_aim(arm, bed):
    session, _, skill = arm
    target = in_world(FACE, as_target(bed))
    trial = session.throw(skill.plan(target))
    assert trial.outcome.landing_seen and trial.outcome.landing_error < 0.06, trial.outcome
    assert trial.outcome.in_basket == trial.ball_was_in
    at_rest = session.plant.state.ball_position
    np.testing.assert_allclose(trial.outcome.landing, at_rest, atol=1.5e-3)
    away_from_wires = (
        np.abs(FACE.on_board(at_rest) - FACE.on_board(trial.outcome.landing)).max() + 1.5
    )
    hit = FACE.on_board(trial.outcome.landing)
    around = hit + away_from_wires * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    assert score(FACE.on_board(at_rest)) in score(around)


def test_a_plan_knows_where_its_own_dart_meets_the_board(arm):
    plan = arm[2].plan(in_world(FACE, [40.0, 80.0]))
    np.testing.assert_allclose(plan.thrown.landing, plan.thrown.target, atol=5e-3)
    np.testing.assert_allclose(
        landing_if_late(plan, 0.0, game_at(BOARD.position)), plan.thrown.landing, atol=1e-4
    )


def test_a_target_far_above_the_board_is_unreachable(arm):
    with pytest.raises(Unreachable, match="target is 2.73 m above the floor"):
        arm[2].plan(in_world(FACE, [0.0, 1000.0]))


@pytest.mark.slow
def test_practice_takes_the_repeatable_miss_out(arm):
    session, shown, _ = arm
    skill, target = PractisingSkill(shown, CONFIGURATION), in_world(FACE, as_target("T20"))
    left = []
    for _ in range(8):
        plan = skill.plan(target)
        told = skill.tell(plan, session.throw(plan).demonstration)
        left.append(np.hypot(*told.left))
    assert np.mean(left[4:]) < 5e-3, left
    assert np.mean(left[4:]) < left[0], left


def test_a_skill_that_lets_go_elsewhere_aims_there_too(arm):
    target, game = in_world(FACE, [0.0, 50.0]), game_at(BOARD.position)
    plan, later = arm[2].plan(target), arm[2].releasing(-0.006).plan(target)
    assert later.release == pytest.approx(plan.release - 0.006)
    assert later.open_hand == pytest.approx(plan.open_hand - 0.006)
    np.testing.assert_allclose(landing_if_late(later, 0.0, game), target, atol=5e-3)


def test_power_does_not_practise_darts(arm):
    with pytest.raises(ValueError, match="PoWER.* baskets"):
        PractisingSkill(arm[1], CONFIGURATION, "power")


def test_a_model_file_knows_that_it_is_about_darts(arm, tmp_path):
    save_model(tmp_path / "darts.npz", arm[1], arm[2].configuration)
    shown, configuration, *_ = load_model(tmp_path / "darts.npz")
    assert configuration == arm[2].configuration and configuration.game is game_at(BOARD.position)
    assert learn_throwing(shown, configuration).model_id == arm[2].model_id


# when to let go


def steadiness_of(arm, lates, slope=(0.0, 0.0)):
    steadiness = PractisingSkill(arm[1], CONFIGURATION).steadiness
    for k, late in enumerate(lates):
        # two kinds of throws, each with its own repeatable miss
        common = np.array([0.01, -0.02]) * (k % 2)
        steadiness.add(k % 2, late, common + late * np.array(slope))
    return steadiness


def test_the_slope_of_what_a_plan_does_not_explain_is_found_for_all_kinds_of_throws_together(arm):
    steadiness = steadiness_of(arm, np.random.default_rng(5).normal(0.0, 0.004, 60), (0.3, -0.8))
    np.testing.assert_allclose(steadiness.slopes, [0.3, -0.8], rtol=0.15)
    assert not steadiness_of(arm, []).slopes.any()


def test_scatter_is_that_of_hits_after_such_releases(arm):
    game, plan = game_at(BOARD.position), arm[2].plan(in_world(FACE, [0.0, 0.0]))
    # between whole milliseconds the scatter is interpolated
    lates = np.random.default_rng(6).normal(0.001, 0.004, 80).round(3)
    rms, middle = steadiness_of(arm, lates).scatter(plan, np.array([-0.004, 0.0]))
    for k, shift in enumerate((-0.004, 0.0)):
        hits = np.array(
            [landing_if_late(plan, shift + late, game) for late in lates]
        ) - landing_if_late(plan, 0.0, game)
        assert rms[k] == pytest.approx(np.sqrt(hits.var(axis=0).sum()), rel=0.02)
        np.testing.assert_allclose(middle[k], np.median(hits @ FACE.axes, axis=0), atol=5e-4)


def test_the_steadiest_release_scatters_less_than_the_demonstrated_one(arm):
    skill, target = arm[2], in_world(FACE, [0.0, 0.0])
    steadiness = steadiness_of(arm, np.random.default_rng(7).normal(0.0, 0.004, 80))

    def plan_for(shift):
        return skill.releasing(shift).plan(target)

    rms = {
        shift: steadiness.scatter(plan_for(shift), np.zeros(1))[0][0]
        for shift in np.arange(-20, 6) * 1e-3
    }
    shift, _ = steadiness.steadiest(plan_for, 0.0, 0.02)
    best = min(rms.values())
    assert steadiness.scatter(plan_for(shift), np.zeros(1))[0][0] < 1.1 * best, (shift, rms)
    assert best < 0.8 * rms[0.0], rms
    assert abs(steadiness.steadiest(plan_for, 0.0, 0.003)[0]) <= 0.003 + 1e-9


def test_a_release_that_was_not_seen_tells_nothing(arm):
    steadiness = steadiness_of(arm, [])
    steadiness.add("throw", np.nan, np.zeros(2))
    steadiness.add("throw", 0.001, np.array([np.nan, 0.0]))
    assert len(steadiness) == 0


# the experiment


def dart(k, spread=5.0, shift=0.0):
    hit = (float(spread * np.sin(k)), float(103.0 + 2 * spread * np.cos(2 * k)))
    covariance = ((spread**2, 0.0), (0.0, 4 * spread**2)) if k > 9 else ((0.0, 0.0), (0.0, 0.0))
    return Dart(
        (0.0, 103.0),
        hit,
        int(score(np.array(hit))),
        covariance,
        30.0 if k > 9 else float("nan"),
        shift,
    )


@pytest.fixture
def faked():
    darts = tuple(dart(k, 8.0 if k < 25 else 3.0, 0.0 if k < 25 else -0.005) for k in range(60))
    return DartsRun(
        0,
        "both",
        BOARD.position,
        ((0.0, 1.0),),
        (*darts, replace(darts[-1], hit=(np.nan, np.nan), score=0, note="lost")),
    )


def test_blocks_say_what_the_darts_say(faked):
    first, second, last = faked.blocks()
    miss = np.array([np.subtract(d.hit, d.aim) for d in faked.darts[:25]])
    assert (first["sd_across_mm"], first["sd_up_mm"]) == pytest.approx(tuple(miss.std(0)))
    assert first["bias_up_mm"] == pytest.approx(miss[:, 1].mean())
    assert first["aims"] == ["T20"] and first["expected_score"] == 30.0
    assert second["sd_up_mm"] < first["sd_up_mm"] and second["release_shift_ms"] == -5.0
    assert (last["first"], last["last"], last["unseen"]) == (51, 61, 1)
    assert "throw 61: lost" in faked.table() and faked.table().count("T20") == 3


@pytest.mark.slow
def test_the_figure_is_always_alike_and_says_what_it_shows(faked):
    text = svg_text(arm_darts_figure(faked))
    assert text == svg_text(arm_darts_figure(faked))
    for words in ("spread [mm]", "bed aimed at", "score of a dart", "T20", "moved by [ms]"):
        assert words in text, words
    with pytest.raises(ValueError, match="nothing to draw"):
        arm_darts_figure(replace(faked, darts=()))


@pytest.mark.parametrize("narrow", (False, True))
def test_the_figure_of_few_darts_shows_what_there_is(narrow):
    """Three darts near the bull were a blob of specks, beside a legend of lines that were not
    drawn, over parts of a throw.
    """
    hits = ((-1.7, 2.4), (-0.6, -7.0), (-2.8, -14.0))
    darts = tuple(
        replace(dart(0), aim=(0.0, 0.0), hit=hit, release_shift=float("nan")) for hit in hits
    )
    figure = arm_darts_figure(DartsRun(0, "both", BOARD.position, ((0.0, 1.0),), darts), narrow)
    figure.draw_without_rendering()
    board, nearer, spread, aim, scores = figure.axes[:5]
    assert [text.get_text() for text in spread.get_legend().get_texts()] == [
        "miss across",
        "miss up and down",
    ]
    assert [text.get_text() for text in scores.get_legend().get_texts()] == ["each dart"]
    assert all(tick == round(tick) for tick in spread.get_xticks())
    assert nearer.get_xlim() == (-20.0, 20.0) and "mm" in nearer.get_title(loc="left")
    titles = [axes._left_title for axes in (spread, aim, scores, board, nearer)]
    boxes = [title.get_window_extent() for title in titles] + [
        one.get_legend().get_window_extent() for one in (spread, scores)
    ]
    for number, box in enumerate(boxes):
        assert box.x1 <= figure.bbox.x1, f"{number}: beyond the edge"
        assert not any(box.overlaps(other) for other in boxes[number + 1 :]), (
            f"{number}: over another text"
        )


def test_hits_about_another_bed_have_no_picture_of_the_middle(faked):
    board, nearer, spread, *_ = arm_darts_figure(faked).axes
    assert not board.child_axes and len(spread.get_legend().get_texts()) == 4
    np.testing.assert_allclose(np.mean(nearer.get_xlim()), faked.darts[-1].aim[0])
    np.testing.assert_allclose(np.mean(nearer.get_ylim()), faked.darts[-1].aim[1])


def test_a_running_mean_is_one_of_what_is_known():
    values = np.array([1.0, 2.0, np.nan, 6.0])
    np.testing.assert_allclose(running(values, 2), [np.nan, 1.5, 2.0, 6.0])


@pytest.mark.slow
def test_a_short_run_knows_only_what_was_seen():
    short = run(seed=2, throws=3, demonstrations=3)
    assert [d.note for d in short.darts] == ["", "", ""]
    for thrown in short.darts:
        assert thrown.score == score(np.array(thrown.hit)) and thrown.aim == (0.0, 0.0)
        assert np.linalg.norm(thrown.hit) < 60.0, thrown


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--board", "2"], "give the distance and the height"),
        (["--throws", "0"], "at least 1"),
        (["--demonstrations", "1"], "at least 1 and 2"),
    ],
)
def test_the_command_says_what_is_wrong(arguments, says, capsys):
    assert main(["experiment", "darts", *arguments]) == 1
    assert says in capsys.readouterr().err


def test_the_rims_are_what_they_were():
    rng = np.random.default_rng(9)
    for _ in range(20):
        position, velocity = (
            rng.uniform([-0.3, -0.3, 1.8], [0.3, 0.3, 2.2]),
            rng.uniform([2, -1, 0], [4, 1, 2]),
        )
        target = np.array([2.0, 0.3, 0.4])
        np.testing.assert_array_equal(
            RIMS.crossing(position, velocity, target).position,
            landing(position, velocity, 0.4).position,
        )


def test_several_seeds_are_a_line_each(faked, capsys, monkeypatch):
    monkeypatch.setattr(
        "dart_skill.experiments.studies.arm_darts.run_seed",
        lambda seed, **_: [replace(faked, seed=seed)],
    )
    assert main(["experiment", "darts", "--seeds", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    on = sum(np.hypot(*dart.hit) < 225.5 for dart in faked.darts)
    assert [line.split()[0] for line in lines[2:]] == [
        "0",
        "1",
        "median",
        "mean",
    ] and f"{on} of {len(faked.darts)}" in lines[2]
    scores = [dart.score for dart in faked.darts]
    assert [float(word) for word in lines[2].split()[1:3]] == pytest.approx(
        [np.mean(scores[:25]), np.mean(scores[-25:])], abs=0.06
    )


def test_what_the_scatter_of_one_plan_allows_is_the_score_at_the_best_aim_for_it():
    """A bias of the plan does not count: practice may take it away."""
    hits = np.random.default_rng(0).normal([40.0, -25.0], [12.0, 20.0], (400, 2))
    unseen = SimpleNamespace(landing=np.full(3, np.nan), landing_seen=False)
    seen = [SimpleNamespace(landing=in_world(FACE, hit), landing_seen=True) for hit in hits]
    thrown = iter([unseen, *seen])
    session = SimpleNamespace(throw=lambda plan: SimpleNamespace(outcome=next(thrown)))
    skill = SimpleNamespace(plan=lambda target: target)
    allowed = allowed_score(session, skill, DARTS, 401)
    assert allowed == pytest.approx(best_aim(np.diag([144.0, 400.0])).expected_score, abs=0.5)


def test_an_arm_that_has_no_plan_has_no_score_that_is_allowed(faked):
    def refuse(target):
        raise Unreachable("too high")

    assert np.isnan(allowed_score(None, SimpleNamespace(plan=refuse), DARTS, 30))
    lines = table_of_seeds([replace(faked, allowed=(20.0, 25.0))] * 2).splitlines()
    assert "allowed" in lines[1] and lines[2].split()[-2:] == ["20.0", "25.0"]
    assert lines[-2].split()[-2:] == ["20.0", "25.0"]


@pytest.mark.slow
def test_an_arm_of_the_fleet_throws_darts_and_knows_what_its_scatter_allows():
    """The scatter is larger than that of the ideal arm."""
    short = run(seed=3000, throws=3, demonstrations=3, arm="fleet", again=8)
    assert len(short.allowed) == 2 and all(5.0 < score < 40.0 for score in short.allowed)
    with pytest.raises(ValueError, match="again is 2: give 0, or at least 6 darts"):
        run(seed=3000, throws=3, demonstrations=3, again=2)


@pytest.mark.parametrize(
    "options",
    [["--seeds", "0"], ["--seeds", "2", "--board", "2.0,1.7"], ["--seeds", "2", "--output", "x"]],
)
def test_several_seeds_are_at_one_board_and_without_a_figure(options, capsys):
    assert main(["experiment", "darts", *options]) == 1
    assert "neither --board nor --output" in capsys.readouterr().err
