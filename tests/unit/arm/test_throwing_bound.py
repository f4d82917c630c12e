"""How far an arm can throw and where it can point: beside linear programming and Pinocchio."""

import json
import re
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from dart_skill.arm import (
    fastest,
    load_arm,
    pointing_region,
    postures,
    swing_plane,
    throwing_bound,
)
from dart_skill.cli import main
from dart_skill.common.configuration import config_path

ARMS = ("wam", "panda", "iiwa7")
"""Those whose URDFs the given packages bring."""


@cache
def bound_of(name):
    return load_arm(name), throwing_bound(load_arm(name), 0.4)


def test_the_fastest_hand_is_that_of_linear_programming():
    rng = np.random.default_rng(0)
    jacobian, limits = rng.normal(size=(40, 2, 4)), rng.uniform(0.5, 3.0, 4)
    jacobian[0, :, 1], jacobian[1, :, 0] = 0.0, [0.3, 0.3]
    direction = np.array([1.0, 1.0]) / np.sqrt(2.0)
    aside = np.array([-direction[1], direction[0]])
    speeds, rates = fastest(jacobian, limits, direction)
    for one, speed, rate in zip(jacobian, speeds, rates, strict=True):
        best = linprog(
            -direction @ one,
            A_eq=[aside @ one],
            b_eq=[0.0],
            bounds=list(zip(-limits, limits, strict=True)),
        )
        assert speed == pytest.approx(-best.fun, abs=1e-9)
        assert direction @ one @ rate == pytest.approx(speed, abs=1e-9)
        assert aside @ one @ rate == pytest.approx(0.0, abs=1e-9)
        assert (np.abs(rate) <= limits + 1e-9).all()


@pytest.mark.parametrize("name", ARMS)
def test_the_hand_moves_in_the_plane_as_pinocchio_says(name):
    arm, plane = load_arm(name), swing_plane(load_arm(name))
    assert plane.joints.tolist() == [1, 3, 5]
    ends = arm.lower[plane.joints], arm.upper[plane.joints]
    angles = np.random.default_rng(1).uniform(*ends, (6, 3))
    places, directions = plane.places(angles)[:, -1], plane.directions(angles)
    for place, direction, q in zip(places, directions, plane.whole(angles), strict=True):
        hand = arm.hand(q)
        assert hand.translation[2] == pytest.approx(place[1], abs=1e-6)
        assert abs(hand.translation[0]) == pytest.approx(abs(place[0]), abs=1e-6)
        assert hand.rotation[2, 2] == pytest.approx(direction[1], abs=1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_the_farthest_throw_keeps_to_the_limits_and_is_what_it_says(name):
    arm, bound = bound_of(name)
    data = arm.model.createData()
    tool = arm.model.getFrameId(arm.tool)
    pin.computeJointJacobians(arm.model, data, bound.angles)
    pin.updateFramePlacements(arm.model, data)
    jacobian = pin.getFrameJacobian(arm.model, data, tool, pin.LOCAL_WORLD_ALIGNED)
    way = data.oMf[tool].rotation @ arm.grip
    velocity = jacobian[:3] @ bound.rates + np.cross(jacobian[3:] @ bound.rates, way)
    assert np.linalg.norm(velocity) == pytest.approx(bound.speed, rel=1e-6)
    assert velocity[2] / bound.speed == pytest.approx(np.sin(bound.angle), abs=1e-5)
    assert (np.abs(bound.rates) <= arm.speeds + 1e-9).all() and bound.torque_share <= 1.0
    for q in (bound.start, bound.angles):
        swings = bound.plane.joints
        assert (q[swings] > arm.lower[swings]).all() and (q[swings] < arm.upper[swings]).all()
    time = (bound.distance - bound.release[0]) / (bound.speed * np.cos(bound.angle))
    height = bound.release[1] + bound.speed * np.sin(bound.angle) * time - 4.905 * time**2
    assert height == pytest.approx(0.4, abs=1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_no_posture_at_random_throws_farther(name):
    """By the kinematics of Pinocchio and linear programming, of a thousandth as many postures."""
    arm, bound = bound_of(name)
    plane, rng = bound.plane, np.random.default_rng(7)
    ends = arm.lower[plane.joints] + 0.15, arm.upper[plane.joints] - 0.15
    direction = np.array([1.0, 1.0]) / np.sqrt(2.0)
    angles = rng.uniform(*ends, (100, 3))
    speeds, rates = fastest(plane.jacobian(angles), arm.speeds[plane.joints], direction)
    begins = angles - 0.15 * rates
    hands = plane.places(angles)[:, -1]
    free = ((begins > ends[0]) & (begins < ends[1])).all(axis=1) & (hands[:, 1] > arm.mount_height)
    rise = speeds / np.sqrt(2.0)
    time = (rise + np.sqrt(np.maximum(rise**2 + 19.62 * (hands[:, 1] - 0.4), 0.0))) / 9.81
    distances = (hands[:, 0] + rise * time)[free]
    assert len(distances) > 5 and distances.max() < bound.distance + 1e-9


@pytest.mark.parametrize(("name", "published"), [("panda", 1.96), ("wam", 3.12), ("iiwa7", 2.05)])
def test_it_is_no_less_than_a_search_for_the_fastest_posture_found(name, published):
    """Distances of the fastest planar swings at 45 degrees, by random postures and linear programming."""
    assert published < bound_of(name)[1].distance < 1.35 * published


@pytest.mark.parametrize("name", ARMS)
def test_a_hand_that_points_down_is_where_it_was_asked(name):
    arm, plane = load_arm(name), swing_plane(load_arm(name), points_along=True)
    places = np.column_stack([[0.45, 0.55, -0.6], [1.1, 1.2, 1.15]])
    angles, near = postures(plane, places, np.array([0.0, -1.0]))
    assert near.all()
    for elbow in angles:
        for q, (x, z) in zip(plane.whole(elbow), places, strict=True):
            hand = arm.hand(q)
            assert hand.translation[2] == pytest.approx(z, abs=1e-6)
            assert abs(hand.translation[0]) == pytest.approx(abs(x), abs=1e-6)
            assert hand.rotation[:, 2] == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)


def test_the_wam_reaches_down_where_its_skills_put_things():
    """config/skills/place.yaml: 0.42 to 0.75 m, the hand 0.2 to 0.3 m over a table at 1.15 m."""
    for height in (1.2, 1.3):
        near, far = pointing_region(load_arm("wam"), height)
        assert near < 0.42 and far > 0.75


def test_beyond_what_the_stretched_arm_reaches_nothing_is_pointed_at():
    with pytest.raises(ValueError, match="arm panda: the hand points there nowhere.*3.00 m"):
        pointing_region(load_arm("panda"), 3.0)
    with pytest.raises(ValueError, match="no posture throws at 45 degrees to a height of 9.00 m"):
        throwing_bound(load_arm("panda"), 9.0)


def test_an_arm_that_hardly_turns_has_a_bound_though_no_person_guides_its_throws(tmp_path, capsys):
    name = load_arm("iiwa7").joints[0].name
    range_of = re.compile(rf'(name="{name}".*?lower=)"[^"]*"( upper=)"[^"]*"', re.DOTALL)
    urdf, changed = range_of.subn(r'\1"-0.3"\2"0.3"', load_arm("iiwa7").urdf)
    assert changed == 1
    (tmp_path / "narrow.urdf").write_text(urdf, encoding="utf-8")
    about = config_path("arms/iiwa7.yaml").read_text(encoding="utf-8")
    file = tmp_path / "narrow.yaml"
    file.write_text(re.sub("urdf: .*", "urdf: narrow.urdf", about, count=1), encoding="utf-8")
    assert main(["arm", "reach", str(file)]) == 0
    told = capsys.readouterr()
    assert "throws 2.5" in told.out and "a person guides" not in told.out
    assert "its first joint cannot turn 45 degrees" in told.err


def test_reach_tells_and_draws_where_an_arm_throws_and_points(tmp_path, capsys):
    assert main(["arm", "reach", "panda", "--output", str(tmp_path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["swinging"] == ["panda_joint2", "panda_joint4", "panda_joint6"]
    assert 1.0 < told["guided_distance_m"] < 1.3
    assert 1.9 < told["distance_m"] < 2.3 and (tmp_path / "reach_panda.svg").is_file()
    assert main(["arm", "reach", "wam", "--json"]) == 0
    assert "guided_start" not in json.loads(capsys.readouterr().out), "its file has a swing"
    assert main(["arm", "reach", "panda", "--skill", "place", "--height", "1.2"]) == 0
    assert "at 1.20 m above the floor: 0." in capsys.readouterr().out
