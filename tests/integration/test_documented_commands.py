"""Every command that README and docs/ show, as a new user would type it: it runs, and what it
promises comes.

The tables below say how each one is run: as it stands, smaller, on a graph that runs, by another
test, or not at all, and why. A command in the docs that no table has fails the first test, and so
does a line of a table that is in the docs no more.
"""

import importlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from dart_skill.cli._completion import commands_of as verbs_of
from dart_skill.cli._main import _parser
from tests.paths import ROOT

PAGES = {
    str(path.relative_to(ROOT)): path
    for path in (
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").rglob("*.md")),
    )
}
PROGRAMS = (
    "dart-skill", "ros2", "make", "pre-commit", "python3", "python", "source", "export", "colcon", "rosdep", "rviz2", "foxglove", "rerun",
    "plotjuggler", "pip", "dask", "chronyc", "ssh", "git", "cd", "sudo", "apt", "docker", "curl", "sphinx-build",
    "lerobot-train", "lerobot-eval", "lerobot-doctor", "lelint", "~/lerobot/bin/python", "~/lerobot/bin/pip", "python3.12",
)  # fmt: skip
PATIENCE = 180.0
"""For any command, or for what a command that stays says when it is ready [s, wall clock]."""


@dataclass(frozen=True)
class Run:
    """Run it. with_: options that replace those of the same name, or are added. says: regular
    expression that its output matches, on stdout or stderr. leaves: pattern of a file that is
    there afterwards. then: what is typed next. until: it stays until Ctrl-C, and says this when it
    is ready. slow: `make test` leaves it out.
    """

    with_: str = ""
    says: str = ""
    leaves: str = ""
    then: str = ""
    until: str = ""
    slow: bool = False


@dataclass(frozen=True)
class OnTheGraph:
    """Run on the graph that `dart-skill up` started for all of them."""

    with_: str = ""
    says: str = ""


@dataclass(frozen=True)
class OtherNumbers:
    """A command of the docs that is run, with other numbers: `of`."""

    of: str


@dataclass(frozen=True)
class Elsewhere:
    """Another test runs it."""

    test: str


@dataclass(frozen=True)
class Not:
    """Not run, and why."""

    reason: str


COMPILES = Not("compiles into the checkout, beside tests that use it; `make setup` does the same")
MAKE = Not(
    "sets a workspace up first, or runs for minutes; what it starts has tests of its own, and the"
    " target is looked up"
)
TESTS = Not("is about the tests themselves")
FLAME = Elsewhere(
    "unit/repository/test_draw_flame.py::test_a_box_is_as_wide_as_its_share_of_the_samples_and_has_the_colour_of_its_node"
)
PICTURES = Not(
    "teaches and practises for minutes, and writes over the pictures of the documentation"
)
FULL_ROS = Not(
    "needs a full ROS installation; names and types are compared with docs/reference.md"
)
COLCON = Elsewhere(
    "unit/repository/test_messages_with_colcon.py::test_the_messages_are_built_beside_the_package_and_brought_up_to_date_the_next_time"
)
ROSBAG2 = Not(
    "is a command of rosbag2, which needs a full ROS installation; what it writes is read in"
    " unit/recording/test_corpus.py"
)
NETWORK = Not("fetches packages from the network")
CLUSTER = Not("needs a Dask cluster")
MACHINES = Not("is about other machines")
WITH_LEROBOT = Not(
    "needs lerobot, with torch 5.4 GB; lerobot_policy_dsgmr/tests train and evaluate where there is one"
)
OWN_TASK = Elsewhere(
    "integration/test_own_task.py::test_the_task_of_the_page_is_shown_with_a_pointer_and_made_elsewhere"
)
WHEEL = Elsewhere(
    "unit/repository/test_wheel.py::test_the_main_job_runs_without_ros_and_says_what_it_leaves_out"
)
RERUN = Elsewhere(
    "unit/recording/test_others.py::test_rerun_counts_every_message_and_finds_no_fault"
)
NODES = Elsewhere("integration/test_executables.py::test_starts_with_ros2_run_and_ends_on_sigint")
ARM = Elsewhere(
    "integration/test_check_arm.py::test_the_registration_of_loose_cameras_is_found_and_written"
)
OF_A_SKILL = Elsewhere("integration/test_check_arm.py::test_the_bodies_are_those_of_the_skill")
REMAPPED = Elsewhere("integration/test_check_arm.py::test_topics_of_another_prefix_are_heard")
MODEL = Elsewhere(
    "integration/test_up.py::test_a_model_that_was_learned_from_a_bag_throws_at_once"
)
REACH = Elsewhere("integration/test_reach.py::test_the_hand_reaches_into_cups_that_move_otherwise")
SKILLS = Elsewhere(
    "integration/test_skills.py::test_a_skill_of_another_package_runs_through_all_nodes_and_the_command"
)
PRACTICE = Elsewhere(
    "integration/test_practice.py::test_the_practice_command_changes_the_arm_on_the_way_and_reports_every_throw"
)
REPLAY = Elsewhere("integration/test_up.py::test_a_recording_is_replayed_into_a_model")
BY_HAND = Elsewhere(
    "integration/test_bags.py::test_a_bag_teaches_through_the_nodes_what_it_teaches_without"
)
ROS1 = Elsewhere("unit/recording/test_recordings_page.py::test_a_bag_of_ros1_is_named_itself")
FOREIGN = Elsewhere(
    "unit/session/test_from_bag.py::test_the_command_reads_a_laboratory_and_its_faults"
)
CAUSE = Elsewhere(
    "unit/session/test_disagreement.py::test_learn_tells_the_cause_instead_of_a_guess"
)
AUTO = Elsewhere(
    "unit/session/test_disagreement.py::test_learn_finds_the_mapping_of_another_laboratory_and_writes_it"
)
REPORT = Elsewhere("unit/report/test_page.py::test_the_command_writes_the_page_and_says_where")
HARDWARE = "foreign_arm/test_foreign_arm.py::"
WITHOUT = Elsewhere(
    "unit/session/test_from_bag.py::test_a_demonstration_can_be_left_out_by_its_id_or_number"
)
ON_HARDWARE = Elsewhere(f"{HARDWARE}test_every_state_of_the_arm_is_answered")
FAULTS = Elsewhere(
    "integration/test_fault_cases.py::test_the_client_is_told_the_arm_rests_and_all_works_again"
)
STATUS = Elsewhere("integration/test_running_graph.py::test_the_status_of_a_graph_that_is_well")
BESIDE = Elsewhere(
    "integration/test_bag_play.py::test_commands_are_played_where_they_are_asked_for_and_no_arm_is"
)
PROFILE = Elsewhere(
    "integration/test_discovery.py::test_a_node_listens_on_loopback_alone_and_a_client_without_the_profile_finds_it"
)
POLICY = Elsewhere(
    "unit/common/test_permissions.py::test_the_command_writes_the_policy_and_no_file_over_another"
)
SECURITY = Not(
    "needs a full ROS installation with SROS 2; what the policy allows is compared with a graph in"
    " test_main_job.py"
)
SPACES = Elsewhere("integration/test_namespaces.py::test_what_one_types_concerns_one_arm")
VIEW = Elsewhere(
    "unit/view/test_rerun.py::test_every_file_of_a_split_bag_is_opened_with_a_layout_of_its_own"
)
LEROBOT = Elsewhere("unit/session/test_lerobot.py::test_the_commands_convert_and_learn")
FILMED = Elsewhere("unit/session/test_lerobot.py::test_a_video_has_a_picture_of_each_frame")

TYPED = {
    "python3 tools/draw_flame.py build/flame.txt docs/flame.svg": FLAME,
    # set up
    "make setup": MAKE,
    "python3 setup.py build_ext --inplace": COMPILES,
    "make setup PYTHON=python3.12": MAKE,
    "make clean": MAKE,
    "make demo": MAKE,
    'make demo ARGS="--seed 3 --throws 20 --output my_run"': MAKE,
    "make test": MAKE,
    "make test-all": MAKE,
    "make lock": MAKE,
    "python3 -m mypy": TESTS,
    "python3 -m pytest tests/unit/repository/test_imports.py": TESTS,
    'python3 -m pytest tests/unit -k "spring and damper" -n 2': TESTS,
    "make test-oldest": MAKE,
    "python3 -m pytest tests/integration/test_strangers.py -x": TESTS,
    "python3 -m pytest tests/foreign_arm/test_placing.py -s -k nine_of_ten": TESTS,
    "HYPOTHESIS_PROFILE=long python3 -m pytest tests/integration/test_fuzz.py": TESTS,
    "python3 -m tests.reference.results tests/reference/results.json": TESTS,
    "python3 tools/make_pictures.py view view_darts view_place view_reach view_by_mouse": PICTURES,
    "make benchmark": MAKE,
    "make growth": MAKE,
    "make docs": MAKE,
    "source tools/env.sh": Run(
        then="command -v dart-skill ros2 && printenv ROS_AUTOMATIC_DISCOVERY_RANGE",
        says="LOCALHOST",
    ),
    "python -m pydoc dart_skill.movement": Run(says="dart_skill.movement"),
    "pip install 'dart_skill[view]'": NETWORK,
    "pip install 'dart_skill[sim]'": NETWORK,
    "pip install 'dart_skill[lerobot]'": NETWORK,
    "pip install 'dart_skill[pandas]'": NETWORK,
    "pip install 'dart_skill[c3d]'": NETWORK,
    "pip install 'dart_skill[foxglove]'": NETWORK,
    "pip install .": WHEEL,
    "pip install --no-build-isolation -e .": OWN_TASK,
    "dart-skill up --skill beside --viewer": OWN_TASK,
    "pip install '.[sim,plot,view]'": WHEEL,
    "dart-skill demo --layout in-process": Elsewhere(
        "integration/test_demo.py::test_in_process_the_arm_throws_the_same_throws_to_the_last_bit"
    ),
    "dart-skill --help": Run(says="usage: dart-skill"),
    "dart-skill --version": Run(says=r"dart-skill \d+\.\d+\.\d+"),
    "python -m dart_skill --help": Run(says="usage: dart-skill"),
    "colcon build --symlink-install --base-paths src/dart_skill src/dart_skill/msg_schemas": Not(
        "set-up does the same in the checkout"
    ),
    "colcon build --symlink-install": COLCON,
    "source install/setup.bash": COLCON,
    "rosdep install --from-paths src/dart_skill src/dart_skill/msg_schemas --ignore-src -y": (
        NETWORK
    ),
    "python3 -m venv --system-site-packages": NETWORK,
    "python -m pip install --upgrade pip": NETWORK,
    "colcon test --packages-select dart_skill --pytest-args tests/unit/mixture": TESTS,
    "pip install -r requirements/optional.txt": NETWORK,
    "pip install py-spy": NETWORK,
    "export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET": MACHINES,
    "export FASTRTPS_DEFAULT_PROFILES_FILE=$PWD/config/fastdds_loopback.xml": PROFILE,
    "dart-skill security policy.xml": POLICY,
    "ros2 run dart_skill commander --ros-args --enclave /dart_skill/commander": SECURITY,
    "export ROS_DOMAIN_ID=7": SECURITY,
    "ros2 security create_keystore keystore": SECURITY,
    "ros2 security generate_artifacts -k keystore -p policy.xml": SECURITY,
    "export ROS_SECURITY_KEYSTORE=$PWD/keystore": SECURITY,
    "export ROS_SECURITY_ENABLE=true": SECURITY,
    "export ROS_SECURITY_STRATEGY=Enforce": SECURITY,
    "export ROS_SECURITY_ENCLAVE_OVERRIDE=/dart_skill/client": SECURITY,
    "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST": MACHINES,
    "export ROS_DOMAIN_ID=42": MACHINES,
    "export ROS_STATIC_PEERS='192.168.10.2;192.168.10.3'": MACHINES,
    "ssh -L 8080:127.0.0.1:8080 HOST": MACHINES,
    "ssh -L 8080:127.0.0.1:8080 robot": MACHINES,
    "chronyc tracking": MACHINES,
    "dask scheduler --host 192.168.10.1": CLUSTER,
    "dask worker tcp://192.168.10.1:8786 --nworkers 8 --nthreads 1": CLUSTER,
    # the graph
    "dart-skill up --viewer": OnTheGraph("--output up --port 0", says="all nodes are ready"),
    "dart-skill up --open": Elsewhere(
        "integration/test_up.py::test_the_page_is_that_of_the_skill_and_its_address_is_told_and_opened"
    ),
    "dart-skill up --viewer --port 0": Elsewhere(
        "integration/test_documented_commands.py::test_a_command_on_the_graph"
    ),
    "dart-skill up --namespace /arm1": Run(until="all nodes are ready"),
    "dart-skill up --namespace /arm2 --seed 1": Run(until="all nodes are ready", slow=True),
    "dart-skill teach --namespace /arm1 --count 5": SPACES,
    "dart-skill status --namespace /arm2": SPACES,
    "dart-skill bag play --namespace /arm2 BAG": SPACES,
    "ros2 launch dart_skill throwing.launch.py namespace:=arm3": FULL_ROS,
    "ros2 run dart_skill commander --ros-args -r __ns:=/arm4": NODES,
    "ros2 run dart_skill recorder --ros-args -p bag:=monday -p use_sim_time:=true": OnTheGraph(),
    "dart-skill teach --count 5": OnTheGraph("--count 2", says="2 of 2 throws shown"),
    "dart-skill status": STATUS,
    "dart-skill learn": OnTheGraph(says="model [0-9a-f]+"),
    "dart-skill learn --at-least 3": OnTheGraph("--at-least 2", says="model [0-9a-f]+"),
    "dart-skill demonstrations": OnTheGraph(says="taught: a throw to"),
    "dart-skill demonstrations drop 3": Elsewhere(
        f"{HARDWARE}test_a_bad_demonstration_is_dropped_and_restored"
    ),
    "dart-skill demo --model monday_model.npz": MODEL,
    "dart-skill up --model monday_model.npz": MODEL,
    "dart-skill throw --model monday_model.npz": MODEL,
    "dart-skill up --layout hardware": ON_HARDWARE,
    "dart-skill up --layout hardware --record tuesday": ON_HARDWARE,
    "dart-skill up --layout hardware --skill place": Elsewhere(
        "foreign_arm/test_placing.py::test_the_arm_places_parts_into_holders_that_nobody_demonstrated"
    ),
    "ros2 run dart_skill recorder --ros-args -p bag:=tuesday": Elsewhere(
        "integration/test_executables.py::test_starts_with_ros2_run_and_ends_on_sigint"
    ),
    "dart-skill throw": Elsewhere(
        f"{HARDWARE}test_the_coach_says_where_a_basket_shall_stand_and_waits_for_it"
    ),
    "dart-skill throw --at 2.0 0.3 0.4": Elsewhere(
        f"{HARDWARE}test_the_coach_says_where_a_basket_shall_stand_and_waits_for_it"
    ),
    "dart-skill practice --running": Elsewhere(
        "integration/test_reach.py::test_practice_tries_it_where_the_coach_draws"
    ),
    "dart-skill practice --running --throws 5": Elsewhere(
        "integration/test_practice.py::test_beside_a_real_arm_nobody_carries_bodies_about_unless_they_ask_for_it"
    ),
    "dart-skill practice --running --throws 20": Elsewhere(
        f"{HARDWARE}test_the_arm_practises_at_the_basket_that_the_cameras_see"
    ),
    "dart-skill learn tuesday": WITHOUT,
    "dart-skill learn tuesday --without demonstration_1795379669631609360 --output better.npz": (
        WITHOUT
    ),
    "dart-skill throw --count 10": OnTheGraph("--count 1", says=r"\d of 1 in the basket"),
    "dart-skill execute --count 5": OnTheGraph("--count 1", says=r"throw: \d of 1 succeeded"),
    "dart-skill demo --skill place": SKILLS,
    "dart-skill demo --skill place --trials 5": SKILLS,
    "dart-skill demo --skill beside": SKILLS,
    "dart-skill demo --skill place --set skill.representation=pose": Run(
        "--demonstrations 3 --trials 1", says="seed 0", leaves="**/report.html", slow=True
    ),
    "dart-skill demo --skill throw --set skill.refinement=aim --set skill.components=12": Run(
        "--demonstrations 2 --throws 1", says="seed 0", leaves="**/report.html", slow=True
    ),
    "dart-skill up --skill place --set skill.practice=bootstrap": Run(
        until=r"next: .*\n", slow=True
    ),
    "dart-skill demo --skill darts": Run(
        "--demonstrations 2 --throws 2",
        says="seed 0, practice of the graph",
        leaves="**/report.html",
        slow=True,
    ),
    "dart-skill up --skill darts --viewer": Elsewhere(
        "integration/test_viewer_skills.py::test_a_skill_is_taught_learned_and_executed_from_the_page"
    ),
    "dart-skill up --skill place --viewer": Elsewhere(
        "integration/test_viewer_skills.py::test_a_skill_is_taught_learned_and_executed_from_the_page"
    ),
    'ros2 action send_goal /execute dart_skill_msgs/action/Execute "{situation: {names: [right, up], numbers: [0.0, 0.103]}}"': (
        FULL_ROS
    ),
    "dart-skill experiment darts --jobs 2 --arm fleet --first-seed 2000 --seeds 40 --throws 100 --again 30": Run(
        "--seeds 1 --throws 1 --demonstrations 2 --again 8", says="allowed", slow=True
    ),
    "dart-skill experiment place --jobs 2 --seeds 4 --set skill.representation=pose --set skill.asked_turn=3.14159": Run(
        "--seeds 1 --parts 1 --demonstrations 3", says="in their holders", slow=True
    ),
    "dart-skill experiment darts --seeds 10 --throws 100 --jobs 2 --configuration intervals": Run(
        "--seeds 1 --throws 1 --demonstrations 2", says="on the board"
    ),
    "dart-skill demo --skill reach": REACH,
    "dart-skill demo --skill reach --trials 5": REACH,
    "dart-skill up --skill place": SKILLS,
    "dart-skill teach --count 8": SKILLS,
    "dart-skill practice --method power --throws 30": PRACTICE,
    "dart-skill practice --method power --throws 30 --output monday": PRACTICE,
    "dart-skill practice --model monday/model.npz --throws 10": PRACTICE,
    "dart-skill practice": PRACTICE,
    "dart-skill practice --change base_turned": PRACTICE,
    "dart-skill practice --change base_turned --change-after 5": PRACTICE,
    "dart-skill up --play bags/demonstrations --rate 0": REPLAY,
    "dart-skill learn --at-least 13": REPLAY,
    "ros2 run dart_skill composed": NODES,
    "ros2 run dart_skill commander": NODES,
    "ros2 run dart_skill demonstration_recorder": NODES,
    "ros2 run dart_skill skill_learner": NODES,
    "ros2 run dart_skill viewer": NODES,
    "ros2 run dart_skill effort_bridge": NODES,
    "ros2 run dart_skill commander --ros-args -p output:=trajectory -p trajectory_action:=/scaled_joint_trajectory_controller/follow_joint_trajectory": Elsewhere(
        "integration/test_trajectory.py::test_a_throw_is_executed_and_the_hand_is_told_where_the_plan_tells_it"
    ),
    "dart-skill check arm": ARM,
    "dart-skill check arm --postures 10 --write cameras.yaml": ARM,
    "dart-skill check arm --skill place": OF_A_SKILL,
    "dart-skill check arm --remap /vrpn_mocap:=/mocap": REMAPPED,
    "ros2 run dart_skill demonstration_recorder --ros-args -p automatic:=true": BY_HAND,
    "dart-skill bag play bags/demonstrations --rate 0 --commands --exclude /demonstrations --wait-for '/joint_states|/wam/(command|teacher_wrench)|/vrpn_mocap/.*/pose'": (
        BY_HAND
    ),
    "ros2 launch dart_skill throwing.launch.py": FULL_ROS,
    "ros2 launch dart_skill throwing.launch.py skill:=place": FULL_ROS,
    "ros2 action send_goal /execute dart_skill_msgs/action/Execute": FULL_ROS,
    'ros2 action send_goal /execute dart_skill_msgs/action/Execute "{}" --feedback': FULL_ROS,
    'ros2 action send_goal /execute dart_skill_msgs/action/Execute "{situation: {names: [frequency, turns], numbers: [0.9, 8.0]}}"': FULL_ROS,
    "ros2 service call /simulation/reset dart_skill_msgs/srv/Reset": FULL_ROS,
    "ros2 launch dart_skill hardware.launch.py": FULL_ROS,
    "ros2 launch dart_skill hardware.launch.py bridge:=true": FULL_ROS,
    "ros2 service call /effort_bridge/reset std_srvs/srv/Trigger": FULL_ROS,
    'ros2 action send_goal /teach dart_skill_msgs/action/Teach "{situation: {bodies: [basket], poses: [{position: {x: 2.0, y: 0.3, z: 0.4}}]}}"': (
        FULL_ROS
    ),
    'ros2 action send_goal /practice dart_skill_msgs/action/Practice "{trials: 20}"': FULL_ROS,
    "ros2 service call /skill_learner/learn dart_skill_msgs/srv/Learn": FULL_ROS,
    "ros2 service call /commander/release_arm std_srvs/srv/SetBool '{data: true}'": FULL_ROS,
    "ros2 service call /demonstration_recorder/start std_srvs/srv/Trigger": FULL_ROS,
    "ros2 service call /demonstration_recorder/stop dart_skill_msgs/srv/StopDemonstration '{keep: true}'": (
        FULL_ROS
    ),
    "ros2 service call /commander/release_arm std_srvs/srv/SetBool '{data: false}'": FULL_ROS,
    "ros2 service call /commander/move_to dart_skill_msgs/srv/MoveArm '{posture: [0.0, -1.1, 0.0, -0.6, 0.0, -0.55, 0.0]}'": (
        FULL_ROS
    ),
    "ros2 service call /commander/get_plan dart_skill_msgs/srv/GetPlan": FULL_ROS,
    "ros2 service call /commander/stop std_srvs/srv/Trigger": FULL_ROS,
    "ros2 service call /commander/reset std_srvs/srv/Trigger": FULL_ROS,
    "ros2 service call /skill_learner/demonstrations dart_skill_msgs/srv/ListDemonstrations": (
        FULL_ROS
    ),
    "ros2 service call /skill_learner/drop_demonstration dart_skill_msgs/srv/DropDemonstration '{id: demonstration_1795379669631609360}'": (
        FULL_ROS
    ),
    "ros2 service call /skill_learner/load dart_skill_msgs/srv/ModelFile '{path: better.npz}'": (
        FULL_ROS
    ),
    "ros2 service call /skill_learner/learn dart_skill_msgs/srv/Learn '{bag: tuesday}'": FULL_ROS,
    "ros2 action send_goal /practice dart_skill_msgs/action/Practice '{trials: 20, follow_bodies: true}' --feedback": (
        FULL_ROS
    ),
    "ros2 action send_goal /practice dart_skill_msgs/action/Practice '{trials: 1, follow_bodies: true, only_execute: true}' --feedback": (
        FULL_ROS
    ),
    "ros2 action send_goal /practice dart_skill_msgs/action/Practice '{situations: [{bodies: [basket], poses: [{position: {x: 2.0, y: 0.3, z: 0.4}}]}], only_execute: true}' --feedback": (
        FULL_ROS
    ),
    "ros2 service call /bag_player/pause std_srvs/srv/SetBool '{data: true}'": FULL_ROS,
    "ros2 service call /bag_player/step dart_skill_msgs/srv/Step '{steps: 10}'": FULL_ROS,
    "ros2 param set /bag_player rate 0.2": FULL_ROS,
    "ros2 param set /skill_learner choose_components bic": FULL_ROS,
    "ros2 param set /skill_learner most_stiffness 800.0": FULL_ROS,
    "ros2 param set /skill_learner least_stiffness 50.0": FULL_ROS,
    # bags
    "dart-skill bag info bags/demonstrations": Run(
        says=r"/demonstrations +dart_skill_msgs/msg/Demonstration +13 "
    ),
    "dart-skill learn bags/demonstrations": Run(
        says="learned from 13 of 13 throws", leaves="demonstrations_model.npz"
    ),
    "dart-skill report bags/throws": Elsewhere(
        "integration/test_report_page.py::test_the_command_says_what_the_bag_holds_and_where_the_page_is"
    ),
    "dart-skill report bags/throws --output throws.html": REPORT,
    "dart-skill bag play bags/throws": Run("--rate 0 --duration 5", says="playing bags/throws"),
    "dart-skill bag info monday": Run(says=r"/clock +rosgraph_msgs/msg/Clock"),
    "dart-skill bag check monday": Run(says=r"monday: (nothing is wrong|[0-9]+ (note|warning))"),
    "dart-skill bag check monday tuesday.mcap": Elsewhere(
        "unit/cli/test_bag.py::test_check_as_json_is_a_list_of_findings"
    ),
    "dart-skill bag check thursday --definitions ~/ws/src/lab_msgs": Elsewhere(
        "unit/cli/test_bag.py::test_a_type_that_the_bag_lacks_can_be_given"
    ),
    "dart-skill bag recover tuesday_0.db3": Elsewhere(
        "unit/recording/test_recovery_sqlite.py::test_the_command_recovers_sqlite_too"
    ),
    "DART_SKILL_CORPUS=~/corpus python3 -m pytest tests/unit/recording/test_corpus.py": TESTS,
    "python3 -m tests.unit.recording.make_corpus FOLDER": TESTS,
    "ros2 bag record": ROSBAG2,
    "ros2 bag reindex": ROSBAG2,
    "dart-skill learn friday": CAUSE,
    "dart-skill learn friday --mapping auto": AUTO,
    "dart-skill bag play monday --rate 0.5 --loop": Run(until="playing monday"),
    "dart-skill bag recover monday --output monday_whole": Run(
        says="complete: nothing is lost", leaves="monday_whole/metadata.yaml"
    ),
    "dart-skill bag play monday --start 3 --duration 5 --topics '/vrpn_mocap/.*' --remap /vrpn_mocap/hand/pose:=/hand/pose": Run(
        "--rate 0", says="playing monday"
    ),
    "dart-skill bag play monday --commands --wait-for /wam/command": BESIDE,
    "dart-skill bag play monday --paused --clock 500 --wait-for /joint_states": Run(
        until="playing monday"
    ),
    "dart-skill learn monday": Run(
        says=(
            "learned from 2 of [3-9] throws with .*; the hand opens [0-9]+ ms after it is told to"
        ),
        leaves="monday_model.npz",
    ),
    "dart-skill learn monday --with-throws --output all.npz": Run(
        says="learned from [3-9] of [3-9] throws", leaves="all.npz"
    ),
    "dart-skill learn monday --demonstrations-topic --output same.npz": Run(
        says="learned 'throw' from 2 demonstrations", leaves="same.npz"
    ),
    "dart-skill learn thursday --mapping thursday.yaml": FOREIGN,
    "dart-skill bag info lab.bag": ROS1,
    "dart-skill learn lab.bag --mapping thursday.yaml": ROS1,
    "dart-skill bag convert thursday --mapping thursday.yaml --output thursday_ours": FOREIGN,
    "dart-skill bag convert bags/demonstrations --to lerobot": LEROBOT,
    "dart-skill bag convert bags/demonstrations --to lerobot --fps 30 --video --output filmed": (
        FILMED
    ),
    "dart-skill learn demonstrations_lerobot": LEROBOT,
    "dart-skill bag convert bags/demonstrations --to lerobot --action pose --output throws": Elsewhere(
        "unit/session/test_lerobot.py::test_a_dataset_of_poses_teaches_the_same_throws"
    ),
    "python3.12 -m venv ~/lerobot": WITH_LEROBOT,
    "~/lerobot/bin/pip install 'lerobot[training,evaluation]>=0.6,<0.7' '.[sim,lerobot]'": WITH_LEROBOT,
    "~/lerobot/bin/pip install ./lerobot_policy_dsgmr ./lerobot_env_dart": WITH_LEROBOT,
    "lerobot-train --policy.type=dsgmr --dataset.repo_id=local/throws --dataset.root=throws --steps=31 --batch_size=64 --output_dir=trained": WITH_LEROBOT,
    "lerobot-eval --policy.path=trained/checkpoints/last/pretrained_model --env.type=dart --env.task=throw --eval.n_episodes=10 --eval.batch_size=1": WITH_LEROBOT,
    "~/lerobot/bin/python -P -m pytest lerobot_policy_dsgmr/tests": WITH_LEROBOT,
    "dart-skill demo --skill place --layout in-process --demonstrations 50 --trials 1 --output place50": Run(
        "--demonstrations 3",
        says="learned 'place' from 3",
        leaves="place50/summary.json",
        slow=True,
    ),
    "dart-skill bag convert place50/bag --to lerobot --action pose --fps 20 --output place": Elsewhere(
        "unit/session/test_lerobot.py::test_a_dataset_of_poses_teaches_the_same_throws"
    ),
    "lerobot-train --policy.type=dsgmr --policy.held=part --policy.frames=[start,holder] --dataset.episodes=[0,1,2,3,4] --dataset.repo_id=local/place --dataset.root=place --steps=15 --batch_size=64 --output_dir=five": WITH_LEROBOT,
    "lerobot-eval --policy.path=five/checkpoints/last/pretrained_model --env.type=dart --env.fps=20 --env.episode_length=240 --eval.n_episodes=20 --eval.batch_size=1 --seed=0": WITH_LEROBOT,
    "lerobot-doctor check throws": WITH_LEROBOT,
    "lelint check ./throws --no-video": WITH_LEROBOT,
    "DART_SKILL_LEROBOT=~/lerobot/bin/python python3 -m pytest tests/unit/recording/test_lerobot.py": Elsewhere(
        "unit/recording/test_lerobot.py::test_lerobot_itself_loads_it"
    ),
    "dart-skill bag convert bags/demonstrations --to csv": Run(
        says="the hand was told to open 13", leaves="demonstrations_csv/mapping.yaml"
    ),
    "dart-skill learn demonstrations_csv --mapping demonstrations_csv/mapping.yaml": Elsewhere(
        "unit/session/test_round_trips.py::test_numbers_that_every_form_keeps_teach_the_same_model"
    ),
    "python3 -m benchmarks.power --gradients": Run(
        "--seeds 1", says="natural actor-critic, normalised 0.3", slow=True
    ),
    "python3 -m benchmarks.few_samples --sets 200": Run("--sets 2", says="15 x 8", slow=True),
    "python3 -m benchmarks.mixtures --pbdlib ~/pbdlib-python": NETWORK,
    "python3 -m benchmarks.growth --picture growth.svg": Run(
        "--largest 5 --seconds 0.01", says="30 dimensions", leaves="growth.svg", slow=True
    ),
    "python3 -m benchmarks.graph.loop": Run(
        "--seconds 1 --layouts composed", says="composed", slow=True
    ),
    "python3 -m benchmarks.graph.large_bags --sizes 0.1 0.3 1 3 10": Run(
        "--sizes 0.001 --commands check", says="0.01 GB", slow=True
    ),
    "python3 -m benchmarks.graph.side_by_side --graphs 1 2 4 8 12 20": Run(
        "--graphs 1 --throws 1", says="1 of 1", slow=True
    ),
    "python3 -m benchmarks.skill.cores": Run(
        "--runs 1 --throws 1 --jobs 1 --workers", says="100%", slow=True
    ),
    "python3 -m benchmarks.skill.waits": Run("--only 501 --spreads 60", says="asked 0.5 s"),
    "python3 -m benchmarks.skill.lessons": Run("--repeats 1 --rows plan", says="plan of a throw"),
    "python3 -m benchmarks.recording": Run("--messages 1000 --repeats 1", says="dart_skill"),
    "python3 -m benchmarks.graph.recorder --seconds 60": Run(
        "--seconds 1", says="messages in 1 s", slow=True
    ),
    # Rerun
    "dart-skill view --install bags/throws": NETWORK,
    "dart-skill view bags/throws": VIEW,
    "dart-skill view bags/throws --foxglove": Elsewhere(
        "unit/view/test_foxglove.py::test_the_command_serves_a_bag_until_ctrl_c"
    ),
    "dart-skill view --foxglove": Elsewhere(
        "integration/test_foxglove.py::test_what_is_published_is_shown_and_what_is_latched_comes_to_who_is_late"
    ),
    "rviz2 -d config/viewers/throwing.rviz": Not(
        "RViz is not here; test_viewer_files.py reads the file"
    ),
    "plotjuggler --layout config/viewers/plotjuggler.xml": Not(
        "PlotJuggler is not here; test_viewer_files.py reads the file"
    ),
    "dart-skill view bags/throws --web": Elsewhere(
        "unit/view/test_rerun.py::test_web_prints_the_address_of_the_page"
    ),
    "python3 -m venv ~/rerun && ~/rerun/bin/pip install rerun-sdk==0.41.0": NETWORK,
    "~/rerun/bin/rerun monday/monday_0.mcap": RERUN,
    "DART_SKILL_RERUN=~/rerun/bin/rerun python3 -m pytest tests/unit/recording/test_others.py": (
        RERUN
    ),
    "rerun mcap info": RERUN,
    "rerun mcap check": RERUN,
    "rerun mcap convert": RERUN,
    # darts
    "dart-skill darts estimate 12 16 19 ...": Run(says="sigma = "),
    "dart-skill darts estimate 12 16 19 3 17 1 25 19 17 50 18 1 3 17 2 2 13 18 16 2 ...": Run(
        says="best aim: "
    ),
    "dart-skill darts aim --sigma 28.3": Run(says="best aim: "),
    "dart-skill darts aim --from 5 --to 60": Run(says="sigma = .* mm: from T20 "),
    "dart-skill darts heatmap --sigma 28.3": Run(says="best aim: ", leaves="figures/*.svg"),
    "dart-skill darts 501 --sigma 20": Run(says="turns on average from 501"),
    "dart-skill darts match --sigma 12 --against 15": Run(
        "--start 60", says="you win .* % if you begin", slow=True
    ),
    "dart-skill darts match --sigma 12 --against 15 --legs 11": OtherNumbers(
        "dart-skill darts match --sigma 12 --against 15"
    ),
    "dart-skill darts match --sigma 12 --against 15 --legs 11 --quick": Run(
        "--start 60", says="both play for the fewest turns"
    ),
    "dart-skill darts search --methods mixture,power,cem,cma,niches,sharpening --schedules thesis,extended --results runs.jsonl": Run(
        "--methods power --schedules thesis --seeds 1", says="power", leaves="runs.jsonl"
    ),
    "dart-skill darts search --methods reinforce,enac,mixture_daspec --schedules thesis,extended --results runs.jsonl": Run(
        "--methods enac --schedules thesis --seeds 1", says="enac", leaves="runs.jsonl", slow=True
    ),
    "dart-skill darts search --methods mixture_automatic --schedules thesis,extended --results runs.jsonl": Run(
        "--schedules thesis --seeds 1", says="mixture_automatic", leaves="runs.jsonl", slow=True
    ),
    "dart-skill darts search --methods mixture_automatic_free,mixture_automatic_tenth --results runs.jsonl": Elsewhere(
        "unit/experiments/test_dart_search.py::test_every_method_runs_and_regret_is_never_negative"
    ),
    "dart-skill darts search --methods mixture_automatic_tenfold,mixture_tenth,mixture_tenfold --results runs.jsonl": Elsewhere(
        "unit/experiments/test_dart_search.py::test_every_method_runs_and_regret_is_never_negative"
    ),
    "dart-skill darts search --reward thrown --methods power,cma,cem,mixture --schedules thesis_12000": Run(
        "--methods power --schedules thesis --seeds 1", says="power +thesis +thrown"
    ),
    # experiments
    "dart-skill experiment throws --seeds 10": Run(
        "--seeds 1 --throws 1 --demonstrations 2", says="default +[01]/1 "
    ),
    "dart-skill demo --arm fleet:3": Elsewhere(
        "integration/test_demo.py::test_the_report_tells_of_this_run"
    ),
    "dart-skill demo --arm elastic": Elsewhere(
        "unit/common/test_fleet.py::test_an_arm_sets_what_the_nodes_have_with_values_of_the_same_kind"
    ),
    "dart-skill demo --set mock_optitrack.noise=0.002": Elsewhere(
        "unit/cli/test_usage.py::test_an_arm_and_a_parameter_reach_the_processes_that_run_their_nodes"
    ),
    "dart-skill experiment throws --arms fleet --first-seed 2000 --seeds 10": Elsewhere(
        "unit/cli/test_usage.py::test_arms_of_the_throws_experiment_are_names_or_the_fleet"
    ),
    "dart-skill experiment throws --seeds 10 --configurations intervals,shown_release,em,two_frames,autonomous,weighted,cross_validated,thesis,thesis_local": Elsewhere(
        "unit/cli/test_usage.py::test_the_throws_experiment_gives_one_row_per_throw_as_json"
    ),
    "dart-skill experiment throws --seeds 5 --configurations default,ladder": Elsewhere(
        "unit/cli/test_usage.py::test_the_ladder_stands_for_its_configurations"
    ),
    "dart-skill experiment soak --minutes 120 --layout processes --speed 1": Elsewhere(
        "integration/test_soak.py::test_a_soak_looks_at_its_processes_after_each_round"
    ),
    "dart-skill experiment soak --minutes 120": Elsewhere(
        "integration/test_soak.py::test_a_soak_looks_at_its_processes_after_each_round"
    ),
    "dart-skill experiment faults --list": Run(says="kill_commander_swing"),
    "dart-skill experiment faults --skill place --list": Run(says="place_kill_commander_motion"),
    "dart-skill experiment faults --case kill_commander_swing": FAULTS,
    "dart-skill experiment faults --page docs/faults.md": FAULTS,
    "dart-skill demo --arm iiwa7 --skill place --layout in-process --trials 3": Run(
        with_="--demonstrations 3 --trials 1", says="place 1/1: holder"
    ),
    "dart-skill experiment place --jobs 2": Run(
        "--seeds 1 --parts 1 --demonstrations 3", says="of 1 parts are in their holders", slow=True
    ),
    "dart-skill experiment place --seeds 4 --parts 5 --demonstrations 1 --set skill.representation=dmp": Run(
        "--seeds 1 --parts 1", says="in their holders", slow=True
    ),
    "dart-skill experiment place --arm fleet --first-seed 3000 --seeds 4 --set skill.representation=dmp": Run(
        "--seeds 1 --parts 1 --demonstrations 1", says="in their holders", slow=True
    ),
    "dart-skill experiment reach --seeds 2 --cups 4 --held 2 --set skill.representation=dmp": Run(
        "--seeds 1 --cups 1 --demonstrations 1 --held 1", says="the phase goes on by", slow=True
    ),
    "dart-skill experiment reach --arm fleet --first-seed 3000 --seeds 4 --cups 3 --held 1 --set skill.representation=dmp": Run(
        "--seeds 1 --cups 1 --demonstrations 1 --held 0", says=r"of 1 ", slow=True
    ),
    "dart-skill experiment place --jobs 2 --set skill.representation=dsgmr": Run(
        "--seeds 1 --parts 1 --demonstrations 3", says="of 1 parts are in their holders", slow=True
    ),
    "dart-skill experiment place --jobs 2 --arm fleet --first-seed 2000 --seeds 40": Run(
        "--seeds 1 --parts 1 --demonstrations 3", says="of 1 parts", slow=True
    ),
    "dart-skill experiment place --jobs 2 --arm fleet --first-seed 2000 --seeds 6 --unseen 0.3": Run(
        "--seeds 1 --parts 1 --demonstrations 3", says="of 1 parts", slow=True
    ),
    "dart-skill experiment reach --jobs 2": Run(
        "--seeds 1 --cups 1 --demonstrations 3 --held 1", says="the phase goes on by", slow=True
    ),
    "dart-skill experiment stir --jobs 2 --pots 2": Run(
        "--seeds 1 --pots 1 --held 0", says="of 1 pots are stirred", slow=True
    ),
    "dart-skill demo --skill stir --demonstrations 1 --layout in-process": Run(
        "--trials 1", says="stir 1/1: pot", slow=True
    ),
    "dart-skill experiment throws --arms panda --seeds 5": Run(
        "--seeds 1 --demonstrations 5 --throws 1", says="default .* 1/1", slow=True
    ),
    "dart-skill experiment throws --arms panda --seeds 1 --trajectory 125 --lag 0.03": Run(
        "--demonstrations 5 --throws 1", says="default .* 1/1", slow=True
    ),
    "dart-skill experiment reach --arm iiwa7 --seeds 1": Run(
        "--cups 1 --demonstrations 3 --held 1", says="the phase goes on by", slow=True
    ),
    "dart-skill experiment place --arm iiwa7 --seeds 1": Run(
        "--parts 1 --demonstrations 3", says="of 1 parts are in their holders", slow=True
    ),
    "dart-skill experiment place --jobs 2 --demonstrations 3 --seeds 4": OtherNumbers(
        "dart-skill experiment place --jobs 2"
    ),
    "dart-skill experiment place --jobs 2 --demonstrations 5 --seeds 4": OtherNumbers(
        "dart-skill experiment place --jobs 2"
    ),
    "dart-skill experiment reach --jobs 2 --demonstrations 3": OtherNumbers(
        "dart-skill experiment reach --jobs 2"
    ),
    "dart-skill experiment reach --jobs 2 --arm fleet --first-seed 2000 --seeds 40": Run(
        "--seeds 1 --cups 1 --demonstrations 3 --held 0", says=r"of 1 ", slow=True
    ),
    "dart-skill experiment rivals --data FOLDER --bag bags/demonstrations --simulated 14 --jobs 2": (
        Elsewhere(
            "unit/experiments/test_rivals.py::test_the_command_prints_a_table_of_what_is_there"
        )
    ),
    "dart-skill experiment real_data --data FOLDER --pbdlib ~/pbdlib-python": NETWORK,
    "dart-skill experiment real_data --data FOLDER --jobs 2": Elsewhere(
        "unit/experiments/test_real_data.py::test_the_command_prints_a_table_of_what_is_there"
    ),
    "dart-skill experiment compliance --configuration intervals": Run(
        "--seeds 1 --throws 1 --demonstrations 4", says="50 to 800 +1 ", slow=True
    ),
    "dart-skill experiment repeatability --throws 50 --configuration intervals": Run(
        "--throws 1 --demonstrations 3", says="1.60 +1 ", slow=True
    ),
    "dart-skill experiment basket --models intervals,autonomous,weighted,thesis,thesis_local,shown_release --figure figures": Run(
        "--models thesis --seeds 1 --throws 1 --demonstrations 3",
        says="thesis",
        leaves="figures/*.svg",
        slow=True,
    ),
    "dart-skill experiment basket --seeds 20 --jobs 8 --results basket.jsonl": Run(
        "--seeds 1 --throws 1 --demonstrations 3", says="default", leaves="basket.jsonl", slow=True
    ),
    "dart-skill experiment basket --scheduler tcp://HOST:8786": CLUSTER,
    "dart-skill experiment attempts --methods residual,newton,bootstrap,power,none --attempts 5 --arms fleet --first-seed 2000 --seeds 14": Elsewhere(
        "unit/experiments/test_attempts.py::test_the_command_throws_at_each_basket_with_each_method"
    ),
    "dart-skill experiment practice --seeds 20 --scheduler tcp://192.168.10.1:8786 --results practice.jsonl": (
        CLUSTER
    ),
    "dart-skill experiment practice --methods residual --demonstrations 3 --throws 20 --tested-after 0,10,20 --seeds 20 --configuration intervals": Run(
        "--throws 1 --tested-after 0,1 --tests 1 --seeds 1", says="residual"
    ),
    "dart-skill experiment practice --methods residual --arms fleet --first-seed 2000 --seeds 40 --throws 50 --tested-after 0,10,25,50": Elsewhere(
        "unit/experiments/test_practice.py::test_a_tiny_run_practises_and_is_tested"
    ),
    "dart-skill experiment practice --methods residual --throws 50 --tested-after 0,10,20,50 --again 16 --seeds 20 --configuration intervals": Elsewhere(
        "unit/experiments/test_practice.py::test_the_floor_is_what_one_plan_scatters_and_is_measured_when_all_else_is_done"
    ),
    "dart-skill experiment practice --methods none,residual,both,bootstrap,power --changes friction --throws 12 --tested-after 0,12 --configuration intervals": Run(
        "--methods none --throws 0 --tested-after 0 --tests 1 --seeds 1 --demonstrations 3",
        says="none +3 ",
        slow=True,
    ),
    "dart-skill experiment practice --methods residual,both,bootstrap,power --demonstrations 3 --throws 20 --tested-after 0,20 --configuration intervals": Elsewhere(
        "unit/experiments/test_practice.py::test_rows_of_methods_demonstrations_and_changes_are_kept_apart"
    ),
    "dart-skill experiment practice --changes slower_hand,friction,base_turned,heavier_ball,weaker_motors --throws 10 --tested-after 0,1,2,5,10 --tests 4 --seeds 20 --configuration intervals": Elsewhere(
        "unit/experiments/test_practice.py::test_the_command_prints_the_table"
    ),
    "dart-skill experiment darts --seed 0 --throws 300 --output figures --configuration intervals": Run(
        "--throws 2 --demonstrations 3", says="throws +across", leaves="figures/*.svg", slow=True
    ),
    "dart-skill experiment landscapes --results landscapes.jsonl": Run(
        "--landscapes vanishing_peak --methods power --seeds 1",
        says="power",
        leaves="landscapes.jsonl",
    ),
    "dart-skill experiment landscapes --methods niches --results landscapes.jsonl": Elsewhere(
        "unit/experiments/test_landscapes.py::test_landscapes_on_the_command_line"
    ),
    "dart-skill experiment figure NUMBER": Run(says="figure 7.1", leaves="figures/*.svg"),
    "dart-skill experiment figure 8.4.4 --teachers 20": Elsewhere(
        "unit/experiments/test_thesis.py::test_the_same_seed_gives_the_same_bytes_and_the_units_are_on_the_axes"
    ),
    "dart-skill experiment figure place_strip --seed 3000": Run(
        says="hand not seen", leaves="figures/place_strip.svg", slow=True
    ),
    "dart-skill arm list": Run(says="wam: 7 joints"),
    "dart-skill arm import my_arm.urdf --tool tool0": Elsewhere(
        "unit/arm/test_urdf_arm.py::test_import_writes_a_file_that_loads_again"
    ),
    "dart-skill arm reach wam": Run(says="wam throws 4"),
    "dart-skill arm reach panda --output figures": Elsewhere(
        "unit/arm/test_throwing_bound.py::test_reach_tells_and_draws_where_an_arm_throws_and_points"
    ),
    "dart-skill arm reach panda --skill place": Run(says="at 1.20 m above the floor: 0.09 to"),
    "dart-skill experiment figure correction": Run(says="margin", leaves="figures/correction.svg"),
    "dart-skill experiment figure landscape": Elsewhere(
        "unit/experiments/test_thesis.py::test_more_gaussians_model_a_landscape_better_but_one_says_less_than_none"
    ),
    "dart-skill experiment figure regrets": Elsewhere(
        "unit/experiments/test_thesis.py::test_regrets_come_with_their_table_and_runs_are_not_run_again"
    ),
    **dict.fromkeys(
        (
            f"dart-skill experiment figure {number}"
            for number in ("3.1", "6.6", "7.4", "8.6", "8.11")
        ),
        Elsewhere(
            "unit/experiments/test_thesis.py::test_the_same_seed_gives_the_same_bytes_and_the_units_are_on_the_axes"
        ),
    ),
}
"""How each command of the docs is run; comments are left out, lines that go on joined."""
PLACEHOLDERS = {"NUMBER": "7.1", "...": ""}
"""What stands in the docs for something of the user's own, and what is typed here."""


# What the docs say

PARSER = _parser()
VERBS = {parser.prog for parser in verbs_of(PARSER)}
"""Commands of `dart-skill` and their verbs."""


def commands_of(text: str) -> dict[str, None]:
    """Commands of a page in their order: lines of blocks, and whole commands in the text; Python,
    tables and numbers are none.
    """
    text = re.sub(r"^```(?!bash|sh|console|\n).*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    blocks = re.compile(r"^```\w*\n.*?^```|(?:^ {4}[^\n]*\n)+", re.MULTILINE | re.DOTALL)
    found = []
    for block in blocks.finditer(text):
        lines = re.sub(r"\\\n\s*", " ", block[0]).splitlines()
        found += [(block.start(), line.strip().removeprefix("$ ")) for line in lines]
    prose = blocks.sub(lambda block: " " * len(block[0]), text)
    found += [
        (quoted.start(), quoted[1])
        for quoted in re.finditer(r"`([^`]+)`", prose)
        if is_whole(quoted[1])
    ]
    typed = (plain(line) for _, line in sorted(found, key=lambda one: one[0]))
    return dict.fromkeys(line for line in typed if is_command(line))


def plain(line: str) -> str:
    """A line without its comment and without more than one space between words."""
    return " ".join(re.sub(r"\s#\s.*", "", line).split())


def is_command(line: str) -> bool:
    """Whether a line begins with a program, maybe after variables that are set for it."""
    return (
        re.sub(r"^([A-Z_]+=\S* )*", "", line).split(" ")[0].removeprefix("~/rerun/bin/")
        in PROGRAMS
    )


def is_whole(quoted: str) -> bool:
    """Whether something in the text is a command that can be typed, not the name of a program, a
    command or a verb.
    """
    words = quoted.split()
    return (
        len(words) > (1 if words[0] in ("make", "dart-skill", "chronyc") else 2)
        and " ".join(words) not in VERBS
    )


DOCUMENTED = {page: commands_of(path.read_text(encoding="utf-8")) for page, path in PAGES.items()}


def with_options(command: str, options: str) -> str:
    """A command whose options are replaced by others of the same name, or that gets them in
    addition.
    """
    words = shlex.split(command)
    pairs = shlex.split(options)
    for name, value in zip(pairs[::2], pairs[1::2], strict=True):
        if name in words:
            words[words.index(name) + 1] = value
        else:
            words += [name, value]
    return shlex.join(words)


def as_typed(command: str, options: str) -> str:
    """What is really typed: placeholders and options filled in. Nothing else is changed."""
    for name, value in PLACEHOLDERS.items():
        command = re.sub(rf"(?<=\s){re.escape(name)}(?=\s|$)", value, command)
    return with_options(command, options) if options else command.strip()


def of_kind(kind) -> list:
    """Parameters of a test for what is run in a certain way, in the order of the pages; each
    command once.
    """
    first = {command: page for page in reversed(DOCUMENTED) for command in DOCUMENTED[page]}
    return [
        pytest.param(
            page,
            command,
            id=f"{page}: {command}"[:90],
            marks=[pytest.mark.slow] if getattr(TYPED[command], "slow", False) else [],
        )
        for page in DOCUMENTED
        for command in DOCUMENTED[page]
        if first[command] == page and isinstance(TYPED.get(command), kind)
    ]


# Whether the tables are those of the docs


@pytest.mark.parametrize("page", PAGES)
def test_every_command_of_a_page_is_in_the_table(page):
    missing = [command for command in DOCUMENTED[page] if command not in TYPED]
    assert not missing, (
        f"{page} shows commands that no test knows: give each a line in TYPED of"
        f" {Path(__file__).name}: {missing}"
    )


def test_every_line_of_the_table_is_in_the_docs():
    shown = {command for commands in DOCUMENTED.values() for command in commands}
    assert not set(TYPED) - shown, (
        f"no page shows these: take them out of TYPED of {Path(__file__).name}:"
        f" {sorted(set(TYPED) - shown)}"
    )


@pytest.mark.parametrize(("page", "command"), of_kind(Elsewhere))
def test_what_another_test_runs_has_that_test(page, command):
    file, name = TYPED[command].test.split("::")
    path = ROOT / "tests" / file
    assert path.is_file() and f"\ndef {name}(" in path.read_text(encoding="utf-8"), (
        f"there is no test {TYPED[command].test}"
    )


def parse(command: str):
    """The options of a `dart-skill` command as its parser understands them; a usage error fails
    the test.
    """
    words = shlex.split(as_typed(command, ""))[1:]
    try:
        return PARSER.parse_args(words)
    except SystemExit as end:
        assert not end.code, f"'{command}' is no command"


def test_every_dart_skill_command_is_one():
    for commands in DOCUMENTED.values():
        for command in commands:
            if command.startswith("dart-skill"):
                parse(command)


@pytest.mark.parametrize(("page", "command"), of_kind(OtherNumbers))
def test_what_is_run_with_other_numbers_differs_in_nothing_else(page, command):
    """Then the two do the same, and to run both would tell nothing new of the command."""
    assert isinstance(TYPED[TYPED[command].of], Run)
    one, other = vars(parse(command)), vars(parse(TYPED[command].of))
    differing = {name for name in one.keys() | other.keys() if one.get(name) != other.get(name)}
    assert differing and all(
        type(options[name]) in (int, float) for name in differing for options in (one, other)
    ), differing


@pytest.mark.parametrize(
    ("page", "command"), [one for one in of_kind(Not) if one.values[1].startswith("make")]
)
def test_make_has_the_target_and_starts_what_exists(page, command):
    if shutil.which("make") is None:
        pytest.skip("no make on this machine")
    told = subprocess.run(
        f"make -n {command.removeprefix('make ')}",
        shell=True,
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert told.returncode == 0, told.stderr
    for started in re.findall(r"exec (dart-skill .*)", told.stdout):
        parse(started)


# What ros2 is asked for, without ros2


def rows_of(node: str) -> str:
    """The section of a node in docs/reference.md, which a test compares with the node itself."""
    return (
        (ROOT / "docs" / "reference.md")
        .read_text(encoding="utf-8")
        .split(f"\n## {node}\n")[1]
        .split("\n## ")[0]
    )


def fill(message, values: dict) -> None:
    """Set fields of a message; one that it does not have, or of another type, fails."""
    for name, value in values.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)


def check_ros2(command: str) -> None:
    """Whether the nodes have what a `ros2` command asks for, and its YAML fits the type."""
    words = shlex.split(command)
    if words[1] == "run":
        assert (ROOT / "nodes" / "dart_skill_nodes" / "executables" / f"{words[3]}.py").is_file()
    elif words[1] == "security":
        assert words[2] in ("create_keystore", "generate_artifacts")
    elif words[1] == "launch":
        assert (ROOT / "launch" / words[3]).is_file()
    elif words[1] == "param":
        assert f"\n| `{words[4]}` \\* |" in rows_of(words[3].strip("/")), (
            f"{words[3]} has no parameter {words[4]} that may be changed"
        )
    else:
        kind, name, type_name, *values = (words[1], *words[3:])
        reference = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
        assert f"| {kind} | `{name}` | `{type_name}` |" in reference, (
            f"no node has {name} of type {type_name}"
        )
        package, folder, type_ = type_name.split("/")
        interface = getattr(importlib.import_module(f"{package}.{folder}"), type_)
        fill(
            interface.Goal() if kind == "action" else interface.Request(),
            yaml.safe_load(values[0]) if values else {},
        )


@pytest.mark.parametrize(
    ("page", "command"), [one for one in of_kind(Not) if re.match("ros2 (?!bag )", one.values[1])]
)
def test_the_nodes_have_what_ros2_is_asked_for(page, command):
    check_ros2(command)


def check_next(said: str) -> None:
    """Whether the command that is recommended at the end is one."""
    for line in re.findall(r"^next: (.*)", said, re.MULTILINE):
        command = re.sub(r"^open .* or |, or open http\S+$", "", line)
        if command.startswith("ros2"):
            check_ros2(command)
        else:
            parse(command)


# What is really run


@dataclass(frozen=True)
class Desks:
    """A working directory for each page, with the bags of the checkout, and what the programs are
    started with.
    """

    folder: Path
    environment: dict[str, str]

    def of(self, page: str) -> Path:
        """That of a page."""
        desk = self.folder / page.replace("/", "_")
        if not desk.exists():
            desk.mkdir()
            shutil.copytree(ROOT / "bags", desk / "bags")
            (desk / "benchmarks").symlink_to(ROOT / "benchmarks")
        return desk

    def run(self, command: str, page: str) -> str:
        """What a command says, on stdout and stderr; it must end well."""
        cwd = ROOT if command.startswith("source ") else self.of(page)
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=cwd,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert done.returncode == 0, (
            f"{command}: status {done.returncode}\n{done.stdout}\n{done.stderr}"
        )
        check_next(done.stdout)
        return done.stdout + done.stderr

    @contextmanager
    def stays(self, command: str, page: str, until: str = "", leaves: str = ""):
        """While a command runs that stays until Ctrl-C, from when it has said something, or a file
        is there; afterwards it must have ended well.
        """
        log = self.of(page) / "said.log"
        with open(log, "wb") as file:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {command}"],
                cwd=self.of(page),
                env=self.environment,
                stdout=file,
                stderr=file,
            )
        try:
            wait_until(
                lambda: is_said(until, log) and (not leaves or list(self.of(page).glob(leaves))),
                log,
                process,
            )
            yield log
            process.send_signal(signal.SIGINT)
            status = process.wait(PATIENCE)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        said = log.read_text(encoding="utf-8", errors="replace")
        assert status == 0 and "Traceback" not in said, (
            f"{command}: status {status} on Ctrl-C\n{said}"
        )
        check_next(said)


def is_said(pattern: str, log: Path) -> bool:
    """Whether a program has said something so far."""
    return re.search(pattern, log.read_text(encoding="utf-8", errors="replace")) is not None


def wait_until(ready, log: Path, process: subprocess.Popen) -> None:
    """Until a program that stays is ready."""
    end = time.monotonic() + PATIENCE
    while not ready():
        assert process.poll() is None, (
            f"ended with status {process.returncode}:\n{log.read_text()}"
        )
        assert time.monotonic() < end, f"was never ready:\n{log.read_text()}"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def desks(tmp_path_factory):
    """Of all pages."""
    return Desks(tmp_path_factory.mktemp("docs"), dict(os.environ))


UP = "dart-skill up --viewer"
RECORD = "ros2 run dart_skill recorder --ros-args -p bag:=monday -p use_sim_time:=true"


@pytest.fixture(scope="module")
def said_on_the_graph(desks):
    """What each command said that was typed while the graph ran, in the order of the pages; a
    recorder ran beside and left `monday`.

    It ends after the first throw: a graph of which every message is recorded takes twice as long.
    """
    said, typed = (
        {},
        [one.values for one in of_kind(OnTheGraph) if one.values[1] not in (UP, RECORD)],
    )
    thrown = (
        next(k for k, (_, command) in enumerate(typed) if command.startswith("dart-skill throw"))
        + 1
    )

    def run(some):
        said.update(
            {
                command: desks.run(as_typed(command, TYPED[command].with_), page)
                for page, command in some
            }
        )

    with desks.stays(as_typed(UP, TYPED[UP].with_), "README.md", r"next: .*\n") as log:
        with desks.stays(RECORD, "docs/bags.md", leaves="monday/*.mcap"):
            run(typed[:thrown])
        run(typed[thrown:])
        said[UP], said[RECORD] = log.read_text(encoding="utf-8"), ""
    return said


@pytest.mark.parametrize(("page", "command"), of_kind(OnTheGraph))
def test_a_command_on_the_graph(page, command, said_on_the_graph):
    assert re.search(TYPED[command].says, said_on_the_graph[command]), said_on_the_graph[command]


@pytest.mark.parametrize(("page", "command"), of_kind(Run))
def test_a_command_of_the_docs(page, command, desks, request):
    how = TYPED[command]
    if "monday" in command:
        request.getfixturevalue("said_on_the_graph")
    typed = as_typed(command, how.with_)
    if how.until:
        with desks.stays(typed, page, how.until):
            return
    said = desks.run(f"{typed} && {how.then}" if how.then else typed, page)
    assert re.search(how.says, said), f"{typed} said nothing like '{how.says}':\n{said}"
    if how.leaves:
        assert list(desks.of(page).glob(how.leaves)), f"{typed} left no {how.leaves}"
