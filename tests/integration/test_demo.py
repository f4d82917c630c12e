"""`dart-skill demo` as a user runs it, small."""

import json
import os
import subprocess

import pytest

from tests.paths import CONFIG

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
    return subprocess.run(["dart-skill", "demo", *arguments], capture_output=True, text=True, timeout=300, **options)


@pytest.fixture(scope="module")
def small_demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "run"
    options = ("--demonstrations", "3", "--throws", "2", "--seed", "1", "--arm", "fleet:3", "--json")
    return _demo(*options, "--output", str(folder)), folder


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
    assert {path.stem for path in folder.glob("*.png")} == PICTURES == {path.stem for path in folder.glob("*.svg")}


def test_the_report_tells_of_this_run(small_demo):
    _, folder = small_demo
    page = (folder / "report.html").read_text(encoding="utf-8")
    summary = json.loads((folder / "summary.json").read_text())
    assert "Demo: 3 demonstrations, 2 throws" in page and "--seed 1 (default 0)" in page and "--arm fleet:3 (default ideal)" in page
    assert "skill_learner.yaml" in page
    for throw in summary["throws"]:
        assert f"{throw['landing'][0]:.3f}" in page and f"{100 * throw['error_m']:.1f}" in page
    assert page.count("<svg") == len(PICTURES)


def test_progress_is_said_on_stderr(small_demo):
    done, _ = small_demo
    assert "demonstration 3/3" in done.stderr and "throw 2/2" in done.stderr


def test_the_logs_say_who_is_ready_and_nothing_that_a_user_cannot_use(small_demo):
    """rclpy warns of eight timers on one clock: 286 of 290 lines once."""
    _, folder = small_demo
    lines = {path.stem: path.read_text().splitlines() for path in (folder / "logs").glob("*.log")}
    assert set(lines) == {"composed", "skill_learner"} and not lines["skill_learner"]
    (ready,) = lines["composed"]
    assert ready.endswith("ready: demonstration_recorder, mock_optitrack, commander, teacher, coach, wam_simulator")


def test_a_folder_that_holds_a_bag_is_not_overwritten(small_demo):
    _, folder = small_demo
    again = _demo("--output", str(folder))
    assert again.returncode == 2
    assert "holds a bag already" in again.stderr


def test_a_job_that_fails_says_why_and_ends_with_status_1(tmp_path):
    config = tmp_path / "config"
    config.mkdir()
    for name in ("wam.yaml", "optitrack.yaml", "commander.yaml", "teacher.yaml", "demonstration_recorder.yaml", "skill_learner.yaml"):
        source = CONFIG / name
        (config / name).write_text(open(source).read())
    (config / "wam_simulator.yaml").write_text("wam_simulator:\n  ros__parameters:\n    start_posture: [0.0]\n")
    environment = {**os.environ, "DART_SKILL_CONFIG": str(config)}
    failed = _demo("--output", str(tmp_path / "run"), env=environment)
    assert failed.returncode == 1
    assert "the demo failed: composed ended with status" in failed.stderr, failed.stderr
