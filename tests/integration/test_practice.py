"""Practice over DDS is practice in process, to the last bit; ground truth has no part in it: for all but the cameras it is garbage here."""

import json
import subprocess

import numpy as np
import pytest
from dart_skill_msgs.msg import SimulationState
from dart_skill_msgs.srv import Plan

from dart_skill.regions import targets_for
from dart_skill.session import Session
from dart_skill.skill.improve import PractisingSkill
from dart_skill.world import ROLES
from dart_skill_nodes.comms import conversions

from .conftest import graphs, plan_request, teach_and_learn

SEED, SHOWN = 4, 3
TO_DEMONSTRATE, TO_PRACTISE = targets_for(SEED, SHOWN, 2)
NEW = np.array([1.95, 0.2, 0.4])
HIDDEN = {"/simulation/state": "/behind_the_scenes/state"}


class Liar:
    """Publishes nonsense where ground truth would be, as often as messages come in."""

    def __init__(self, client):
        self._coach, self._spin, self.told = client, client.spin, 0
        self._rng = np.random.default_rng(0)
        self._publisher = client.node.create_publisher(SimulationState, "/simulation/state", 10)
        client.spin = self._spin_and_lie

    def _spin_and_lie(self):
        message = SimulationState(episode=int(self._rng.integers(1000)), success=bool(self._rng.integers(2)))
        message.header.frame_id, message.header.stamp = "world", conversions.time_msg(int(self._rng.integers(10**11)))
        message.joint_position, message.joint_velocity = self._rng.standard_normal(7), self._rng.standard_normal(7)
        message.bodies = [conversions.body_state(role, self._rng.standard_normal(3)) for role in ROLES]
        self._publisher.publish(message)
        self.told += 1
        self._spin()


@pytest.fixture(scope="module")
def practised(ros, tmp_path_factory):
    """Three lessons, two practised throws and a plan, by the nodes; nobody but the cameras and the simulator has the truth."""
    with graphs(tmp_path_factory.mktemp("practice")) as make:
        graph, client = make(None, remappings={name: HIDDEN for name in ("wam_simulator", "mock_optitrack")})
        liar = Liar(client)
        graph.start_all("processes", SEED, tmp_path_factory.mktemp("bag") / "bag", {"skill_learner": {"practice_method": "both"}})
        client.wait_until_ready()
        teach_and_learn(client, TO_DEMONSTRATE)
        phases = []
        result = client.practise(targets=TO_PRACTISE, on_feedback=lambda feedback: phases.append((feedback.number, feedback.phase)))
        plan = client.call(client.node.create_client(Plan, "/skill_learner/plan"), plan_request(NEW)).plan
    assert liar.told > 10
    return {"result": result, "phases": phases, "plan": plan}


@pytest.fixture(scope="module")
def in_process():
    """The same without ROS."""
    session = Session(SEED)
    skill = PractisingSkill([session.teach(target)[-1].demonstration for target in TO_DEMONSTRATE], method="both")
    landings = []
    for target in TO_PRACTISE:
        plan = skill.plan(target)
        trial = session.throw(plan)
        landings.append(trial.outcome.landing)
        assert skill.tell(plan, trial.demonstration).kept
    session.close()
    return {"landings": landings, "plan": skill.plan(NEW), "n": len(skill.practice.demonstrations)}


def test_every_throw_is_made_and_learned_from(practised):
    result = practised["result"]
    assert result.success, result.message
    assert (result.executed, result.learned) == (2, 2)
    assert [outcome.seen for outcome in result.outcomes] == [True] * 2
    assert practised["phases"][-1] == (2, "done")


def test_landings_and_what_was_learned_are_those_of_the_session_to_the_last_bit(practised, in_process):
    landings = [conversions.seen_at(outcome, "landing") for outcome in practised["result"].outcomes]
    np.testing.assert_array_equal(landings, in_process["landings"])
    plan = conversions.throw_plan(practised["plan"])
    for part in ("aim", "predicted_landing", "attractor_position"):
        np.testing.assert_array_equal(getattr(plan, part), getattr(in_process["plan"], part), part)


def test_the_practice_command_changes_the_arm_on_the_way_and_reports_every_throw(tmp_path):
    command = [
        "dart-skill",
        "practice",
        "--demonstrations",
        "2",
        "--throws",
        "2",
        "--change",
        "base_turned",
        "--change-after",
        "1",
        "--json",
    ]
    done = subprocess.run([*command, "--output", str(tmp_path / "out")], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["thrown"] == summary["learned"] == len(summary["throws"]) == 2
    assert (summary["skill"], summary["tried"], len(summary["trials"])) == ("throw", 2, 2)
    assert summary["succeeded"] == sum(trial["success"] for trial in summary["trials"])
    errors = [throw["error_m"] for throw in summary["throws"]]
    assert errors[1] > 0.08 > errors[0], f"five degrees at 1.5 m and more: {errors}"
    assert "from now on: base_turned" in done.stderr
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert summary == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "base turned" in page and "base_turned, after 1 own throws, unannounced" in page
