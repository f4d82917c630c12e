"""`dart-skill demo` as a user runs it, small."""

import json
import os
import subprocess

import pytest

from dart_skill.recording import BagReader
from dart_skill.session import learn_from_bag
from tests.paths import CONFIG
from tests.warm import starting_warm

COLD = True

FIELDS = {
    "seed",
    "bag",
    "thrown",
    "in",
    "median_error_m",
    "p90_error_m",
    "wall_seconds",
    "real_time_factor",
    "throw_real_time_factor",
    "throws",
}
PICTURES = {"curve", "landings", "synchronisation", "gaussians", "execution"}


def _demo(*arguments, **options):
    return subprocess.run(
        ["dart-skill", "demo", *arguments], capture_output=True, text=True, timeout=300, **options
    )


def _warm_demo(*arguments, **options):
    """The same, not started anew as by a user: what it says and does is looked at, not how it
    begins.
    """
    with starting_warm():
        return _demo(*arguments, **options)


SHOWN = 2
SMALL = (
    "--demonstrations",
    f"{SHOWN}",
    "--throws",
    "2",
    "--seed",
    "1",
    "--arm",
    "fleet:3",
    "--json",
)


@pytest.fixture(scope="module")
def small_demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "run"
    return _demo(*SMALL, "--output", str(folder)), folder


@pytest.fixture(scope="module")
def without_ros(tmp_path_factory):
    """The same in one process."""
    folder = tmp_path_factory.mktemp("in_process") / "run"
    return _warm_demo(*SMALL, "--layout", "in-process", "--output", str(folder)), folder


def test_the_demo_ends_well_and_prints_nothing_but_json_on_stdout(small_demo):
    done, folder = small_demo
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert set(summary) >= FIELDS
    assert summary["seed"] == 1 and summary["thrown"] == 2
    assert summary == json.loads((folder / "summary.json").read_text())
    for throw in summary["throws"]:
        assert set(throw) >= {"target", "landing", "error_m", "in"}


def test_bag_and_pictures_are_left_behind(small_demo):
    _, folder = small_demo
    assert (folder / "bag" / "metadata.yaml").is_file()
    assert (
        {path.stem for path in folder.glob("*.png")}
        == PICTURES
        == {path.stem for path in folder.glob("*.svg")}
    )


def test_the_report_tells_of_this_run(small_demo):
    _, folder = small_demo
    page = (folder / "report.html").read_text(encoding="utf-8")
    summary = json.loads((folder / "summary.json").read_text())
    assert (
        f"Throw: {SHOWN} demonstrations, 2 throws" in page
        and "--seed 1 (default 0)" in page
        and "--arm fleet:3 (default ideal)" in page
    )
    assert "skill_learner.yaml" in page
    for throw in summary["throws"]:
        assert f"{throw['landing'][0]:.3f}" in page and f"{100 * throw['error_m']:.1f}" in page
    assert page.count("<svg") == 2 * len(PICTURES), "each for a broad and for a narrow screen"


@pytest.mark.slow
def test_in_process_the_arm_throws_the_same_throws_to_the_last_bit(small_demo, without_ros):
    over_nodes, alone = (json.loads(done.stdout) for done, _ in (small_demo, without_ros))
    for field in ("throws", "trials", "attempts", "in", "median_error_m"):
        assert alone[field] == over_nodes[field], field
    assert set(alone) == set(over_nodes) and (alone["layout"], over_nodes["layout"]) == (
        "in-process",
        "composed",
    )


def test_in_process_the_same_is_left_behind_but_logs_and_that_is_said(small_demo, without_ros):
    left, left_alone = (
        {path.name for path in folder.iterdir()} for _, folder in (small_demo, without_ros)
    )
    assert left - left_alone == {"logs"} and not left_alone - left
    assert "no nodes run, so there are no logs" in without_ros[0].stderr


def test_the_bag_of_one_process_teaches_what_the_bag_of_the_graph_teaches(small_demo, without_ros):
    """The world of the graph begins a little earlier, as its nodes find each other."""
    (model, report), (other, others) = (
        learn_from_bag(folder / "bag") for _, folder in (small_demo, without_ros)
    )
    assert model.skill.model_id == other.skill.model_id
    assert (
        [throw.taught for throw in report.throws]
        == [throw.taught for throw in others.throws]
        == [True] * SHOWN + [False] * 2
    )
    topics = []
    for _, folder in (small_demo, without_ros):
        with BagReader(folder / "bag") as bag:
            topics.append(
                {name: (one.type_name, one.type_hash) for name, one in bag.topics.items()}
            )
            assert bag.custom_data["seed"] == "1" and {
                item.name for item in bag.attachments()
            } >= {"wam.urdf", "world.yaml"}
    assert topics[0] == topics[1]


def test_progress_is_said_on_stderr(small_demo):
    done, _ = small_demo
    assert f"demonstration {SHOWN}/{SHOWN}" in done.stderr and "throw 2/2" in done.stderr


def test_the_logs_say_who_is_ready_and_nothing_that_a_user_cannot_use(small_demo):
    """rclpy warns of eight timers on one clock: 286 of 290 lines once."""
    _, folder = small_demo
    lines = {path.stem: path.read_text().splitlines() for path in (folder / "logs").glob("*.log")}
    assert set(lines) == {"composed", "skill_learner"} and not lines["skill_learner"]
    (ready,) = lines["composed"]
    assert ready.endswith(
        "ready: demonstration_recorder, mock_optitrack, commander, teacher, coach, wam_simulator"
    )


def test_a_folder_that_holds_a_bag_is_not_overwritten(small_demo):
    _, folder = small_demo
    again = _warm_demo("--output", str(folder))
    assert again.returncode == 2
    assert "holds a bag already" in again.stderr


def test_a_job_that_fails_says_why_and_ends_with_status_1(tmp_path):
    config = tmp_path / "config"
    config.mkdir()
    for name in (
        "wam.yaml",
        "optitrack.yaml",
        "commander.yaml",
        "teacher.yaml",
        "demonstration_recorder.yaml",
        "skill_learner.yaml",
    ):
        source = CONFIG / name
        (config / name).write_text(open(source).read())
    (config / "wam_simulator.yaml").write_text(
        "wam_simulator:\n  ros__parameters:\n    start_posture: [0.0]\n"
    )
    environment = {**os.environ, "DART_SKILL_CONFIG": str(config)}
    failed = _warm_demo("--output", str(tmp_path / "run"), env=environment)
    assert failed.returncode == 1
    assert "the demo failed: composed ended with status" in failed.stderr, failed.stderr
