"""Arms by name and by seed: within their ranges, the same again, and each what the nodes take."""

import numpy as np
import pytest

from dart_skill.common.configuration import load_yaml, node_file, node_parameters
from dart_skill.common.fleet import arm_named, arm_with, drawn
from dart_skill.simulation import MotionCaptureConfig, PlantSettings

NODES = ("wam_simulator", "teacher", "commander", "mock_optitrack")


@pytest.mark.parametrize("name", [*load_yaml("fleet.yaml")["arms"], "fleet:0", "fleet:17"])
def test_an_arm_sets_what_the_nodes_have_with_values_of_the_same_kind(name):
    for node, parameters in arm_named(name).items():
        usual = node_parameters(node_file(node), node)
        for parameter, value in parameters.items():
            assert type(value) is type(usual[parameter]), (node, parameter)
            # one number of a joint stands for all of them
            assert np.shape(usual[parameter]) in (np.shape(value), (1,))
    merged = {
        node: {**node_parameters(node_file(node), node), **arm_named(name).get(node, {})}
        for node in NODES
    }
    PlantSettings.from_parameters(merged["wam_simulator"])
    MotionCaptureConfig.from_parameters(merged["mock_optitrack"])


def test_ideal_is_the_files_as_they_are():
    assert arm_named("ideal") == {}


def test_a_seed_draws_the_same_arm_again_and_another_seed_another():
    assert arm_named("fleet:5") == arm_named("fleet:5") != arm_named("fleet:6")


def test_members_stay_within_the_ranges_and_fill_them():
    members = [arm_named(f"fleet:{seed}") for seed in range(200)]
    for node, rules in load_yaml("fleet.yaml")["fleet"].items():
        for parameter, rule in rules.items():
            values = np.array([member[node][parameter] for member in members])
            if not isinstance(rule, dict):
                assert set(values.tolist()) == {rule}
            elif "between" in rule:
                share = values / np.array(rule.get("times", 1.0))
                low, high = rule["between"]
                assert (
                    low <= share.min()
                    and share.max() <= high
                    and np.ptp(share) > 0.9 * (high - low)
                )
            elif "normal" in rule:
                mean, deviation = rule["normal"]
                assert (
                    values.std() == pytest.approx(deviation, rel=0.2)
                    and abs(values.mean() - mean) < 0.3 * deviation
                )
            else:
                assert set(values.tolist()) == set(rule["choice"])


def test_a_new_parameter_changes_none_of_the_others():
    rules = {"wam_simulator": {"hand_delay": {"between": [0.0, 1.0]}}}
    more = {"wam_simulator": {"another": {"normal": [0.0, 1.0]}, **rules["wam_simulator"]}}
    assert (
        drawn(more, 3)["wam_simulator"]["hand_delay"]
        == drawn(rules, 3)["wam_simulator"]["hand_delay"]
    )


@pytest.mark.parametrize("name", ["nobody", "fleet", "fleet:", "fleet:-1", "fleet:x"])
def test_an_arm_that_does_not_exist_is_refused_by_name(name):
    with pytest.raises(ValueError, match=f"no arm '{name}': choose fleet:SEED.*ideal"):
        arm_named(name)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{between: [0.02, 0.06]}", "{about: 3}", "hand_delay has an unknown entry 'about'"),
        (
            "{between: [0.02, 0.06]}",
            "{each: 3}",
            "hand_delay is .* one of between, normal, choice",
        ),
        ("{between: [0.02, 0.06]}", "{between: [0.06, 0.02]}", "hand_delay is .* in order"),
        (
            "{between: [0.02, 0.06]}",
            "soon",
            "hand_delay is 'soon'; it must be a number from 0 to 1",
        ),
        (
            "    hand_delay:",
            "    hand_delya:",
            "unknown entry 'hand_delya': did you mean hand_delay",
        ),
    ],
)
def test_a_rule_that_is_none_is_refused_with_its_place(edited, old, new, said):
    edited("fleet.yaml", old, new)
    with pytest.raises(ValueError, match=f"fleet.yaml: fleet.wam_simulator.*{said}"):
        arm_named("fleet:3")


def test_an_arm_with_a_parameter_of_its_own():
    arm = arm_with("elastic", ["commander.tracking=none", "mock_optitrack.noise=1"])
    assert arm["commander"]["tracking"] == "none" and arm["mock_optitrack"]["noise"] == 1.0
    assert (
        arm["wam_simulator"] == arm_named("elastic")["wam_simulator"]
        and arm_named("elastic")["commander"]["tracking"] == "joints"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("noise=1", "give NODE.PARAMETER=VALUE"),
        ("mock_optitrack.noise", "give NODE.PARAMETER=VALUE"),
        ("dishwasher.noise=1", "there is no node dishwasher"),
        ("mock_optitrack.nose=1", "mock_optitrack has no parameter nose; it has .*noise"),
        ("mock_optitrack.noise=loud", "'loud' is no float, which noise is"),
    ],
)
def test_a_parameter_that_does_not_exist_is_named(text, message):
    with pytest.raises(ValueError, match=message):
        arm_with("ideal", [text])
