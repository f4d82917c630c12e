"""Practice over DDS is practice in process, to the last bit; ground truth has no part in it: for
all but the cameras it is garbage here.
"""

import argparse
import json
import subprocess

import numpy as np
import pytest
from dart_skill_msgs.action import Execute, Practice
from dart_skill_msgs.msg import SimulationState
from dart_skill_msgs.srv import Plan

from dart_skill.arm import same_plan
from dart_skill.common.regions import targets_for
from dart_skill.common.world import ROLES
from dart_skill.session import Session
from dart_skill.skills.learning import load_model
from dart_skill.skills.practice import PractisingSkill, practised_skill
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.verbs import practice
from dart_skill_nodes.verbs.trials import try_all
from tests.integration.conftest import graphs, plan_request, teach_and_learn

SEED, SHOWN = 4, 2
TO_DEMONSTRATE, TO_PRACTISE = targets_for(SEED, SHOWN, 2)
NEW = np.array([1.95, 0.2, 0.4])
HIDDEN = {
    f"{node}:/simulation/state": "/behind_the_scenes/state"
    for node in ("wam_simulator", "mock_optitrack")
}


class Liar:
    """Publishes nonsense where ground truth would be, as often as messages come in."""

    def __init__(self, client):
        self._coach, self._spin, self.told = client, client.spin, 0
        self._rng = np.random.default_rng(0)
        self._publisher = client.node.create_publisher(SimulationState, "/simulation/state", 10)
        client.spin = self._spin_and_lie

    def _spin_and_lie(self):
        message = SimulationState(
            episode=int(self._rng.integers(1000)), success=bool(self._rng.integers(2))
        )
        message.header.frame_id, message.header.stamp = (
            "world",
            conversions.time_msg(int(self._rng.integers(10**11))),
        )
        for what in ("joint_position", "joint_velocity", "joint_effort"):
            setattr(message, what, self._rng.standard_normal(7))
        message.bodies = [
            conversions.body_state(role, self._rng.standard_normal(3)) for role in ROLES
        ]
        self._publisher.publish(message)
        self.told += 1
        self._spin()


@pytest.fixture(scope="module")
def practised(ros, tmp_path_factory):
    """Two lessons, two practised throws and a plan, by the nodes; nobody but the cameras and the
    simulator has the truth.
    """
    with graphs(tmp_path_factory.mktemp("practice")) as make:
        graph, client = make(None, remappings={"composed": HIDDEN})
        liar = Liar(client)
        graph.start_all(
            "composed",
            SEED,
            tmp_path_factory.mktemp("bag") / "bag",
            {"skill_learner": {"practice_method": "both"}},
        )
        client.wait_until_ready()
        teach_and_learn(client, TO_DEMONSTRATE)
        phases = []
        result = client.practise(
            targets=TO_PRACTISE,
            on_feedback=lambda feedback: phases.append((feedback.number, feedback.phase)),
        )
        plan = client.call(
            client.node.create_client(Plan, "/skill_learner/plan"), plan_request(NEW)
        ).plan
    assert liar.told > 10
    return {"result": result, "phases": phases, "plan": plan}


@pytest.fixture(scope="module")
def in_process():
    """The same without ROS."""
    session = Session(SEED)
    skill = PractisingSkill(
        [session.teach(target)[-1].demonstration for target in TO_DEMONSTRATE], method="both"
    )
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


def test_landings_and_what_was_learned_are_those_of_the_session_to_the_last_bit(
    practised, in_process
):
    landings = [
        conversions.seen_at(outcome, "landing") for outcome in practised["result"].outcomes
    ]
    np.testing.assert_array_equal(landings, in_process["landings"])
    plan = conversions.throw_plan(practised["plan"])
    assert same_plan(plan, in_process["plan"])


@pytest.mark.slow
def test_power_explores_and_learns_over_the_nodes_as_in_process_and_its_model_goes_on(
    make_graph, tmp_path
):
    """Five throws as they are planned, then two with which PoWER tries something else; a test
    between them teaches nothing.
    """
    shown, targets = targets_for(SEED, 2, 7)
    _, client = make_graph(seed=SEED, extra={"skill_learner": {"practice_method": "power"}})
    teach_and_learn(client, shown)
    outcomes = client.practise(targets=targets[:6]).outcomes
    outcomes += client.practise(targets=targets[:1], only_throw=True).outcomes
    outcomes += client.practise(targets=targets[6:]).outcomes
    planner = client.node.create_client(Plan, "/skill_learner/plan")
    plan = conversions.throw_plan(client.call(planner, plan_request(NEW)).plan)
    model_id = client.save(tmp_path / "practised.npz")
    client.learn()
    assert not np.array_equal(
        conversions.throw_plan(client.call(planner, plan_request(NEW)).plan).thrown.aim,
        plan.thrown.aim,
    ), "begins anew"
    assert client.load(tmp_path / "practised.npz") == model_id
    again = conversions.throw_plan(client.call(planner, plan_request(NEW)).plan)
    assert same_plan(again, plan), "what PoWER found is in the model"

    session, landings = Session(SEED), []
    skill = PractisingSkill(
        [session.teach(target)[-1].demonstration for target in shown], method="power"
    )
    for target, learns in [
        *((target, True) for target in targets[:6]),
        (targets[0], False),
        (targets[6], True),
    ]:
        planned = skill.plan(target, explore=learns)
        trial = session.throw(planned)
        landings.append(trial.outcome.landing)
        if learns:
            assert skill.tell(planned, trial.demonstration).kept
    session.close()
    assert skill.search.open == 0 and (skill.search.spread > 0.0).all()
    np.testing.assert_array_equal(
        [conversions.seen_at(outcome, "landing") for outcome in outcomes], landings
    )
    np.testing.assert_array_equal(plan.thrown.aim, skill.plan(NEW).thrown.aim)
    loaded = practised_skill(load_model(tmp_path / "practised.npz"))
    assert loaded.method == "power" and same_plan(loaded.plan(NEW), skill.plan(NEW)), (
        "also without ROS, and whatever method is asked for"
    )
    assert json.dumps(loaded.search.state()) == json.dumps(skill.search.state())


@pytest.mark.slow
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
        "--tests",
        "1",
        "--json",
    ]
    done = subprocess.run(
        [*command, "--output", str(tmp_path / "out")], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["thrown"] == summary["learned"] == len(summary["throws"]) == 2
    assert (summary["skill"], summary["tried"], len(summary["trials"])) == ("throw", 2, 2)
    assert summary["succeeded"] == sum(trial["success"] for trial in summary["trials"])
    errors = [throw["error_m"] for throw in summary["throws"]]
    assert errors[1] > 0.08 > errors[0], f"five degrees at 1.5 m and more: {errors}"
    assert "from now on: base_turned" in done.stderr
    assert practised_skill(load_model(tmp_path / "out" / "model.npz")).practised == 2
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert summary == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [(one["when"], one["after_throws"], len(one["throws"])) for one in summary["tests"]] == [
        ("before practice", 0, 1), ("after the change", 1, 1), ("after practice", 2, 1),
    ]  # fmt: skip
    before, changed, after = (one["throws"][0] for one in summary["tests"])
    assert before["target_m"] == changed["target_m"] == after["target_m"], (
        "the same baskets in each test"
    )
    assert changed["error_m"] > 0.08 > before["error_m"] and after["error_m"] < changed["error_m"]
    assert "after practice: median landing error at 1 fixed baskets" in page
    assert "base turned" in page and "base_turned, after 1 own throws, unannounced" in page

    command = [
        "dart-skill",
        "practice",
        "--model",
        str(tmp_path / "out" / "model.npz"),
        "--throws",
        "1",
        "--tests",
        "0",
    ]
    done = subprocess.run(
        [*command, "--output", str(tmp_path / "on")], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "nothing is shown" in done.stderr
    assert (
        f"next: dart-skill practice --model {tmp_path / 'on' / 'model.npz'}"
        in done.stdout.splitlines()
    ), "it can be copied"
    on = practised_skill(load_model(tmp_path / "on" / "model.npz"))
    assert on.practised == 3 and len(on.correction) + len(on.correction.suspicions()) == 3
    assert "Practice: the model model.npz, 1 own throws" in (
        tmp_path / "on" / "report.html"
    ).read_text(encoding="utf-8")


def row(error):
    return {
        "target_m": [2.0, 0.0, 0.4],
        "landing_m": None,
        "error_m": error,
        "in_basket": error is not None and error < 0.15,
    }


def summary_of(tests, throws):
    names = ("before practice", "after the change", "after practice")
    names = names if len(tests) == 3 else names[::2]
    after = (0, 2, len(throws)) if len(tests) == 3 else (0, len(throws))
    told = [
        {"when": when, "after_throws": n, "throws": [*map(row, test)]}
        for when, n, test in zip(names, after, tests, strict=True)
    ]
    return {
        "tests": told,
        "throws": [*map(row, throws)],
        "thrown": len(throws),
        "learned": len(throws),
        "wall_seconds": 1.0,
    }


def test_practice_whose_throws_get_worse_is_not_called_harm_where_its_tests_get_better():
    """The coach throws where it expects the worst, so the errors of the practised throws may rise
    while the arm gets better.
    """
    told = practice.table(
        summary_of([(0.010, 0.020), (0.005, 0.008)], (0.01, 0.02, 0.03, 0.04, 0.05, 0.06))
    )
    lines = told.splitlines()
    assert lines[0].startswith("at the same 2 baskets")
    assert lines[2].split() == ["before", "practice", "2/2", "1.50", "2.00"] and lines[
        3
    ].split() == [
        "after",
        "practice",
        "2/2",
        "0.65",
        "0.80",
    ]
    assert lines[4] == "nearer to the middle after practice than before practice: 2 of 2 baskets"
    assert told.index("the practised throws, at baskets where a throw teaches most") > told.index(
        lines[4]
    )


def test_practice_after_a_change_is_compared_with_the_arm_that_had_changed():
    told = practice.table(summary_of([(0.01, 0.01), (0.2, None), (0.02, 0.02)], (0.01,) * 4))
    assert "nearer to the middle after practice than after the change: 1 of 1 baskets" in told, (
        "of those that were seen"
    )


def test_practice_without_tests_says_that_its_table_does_not_judge_it():
    told = practice.table({**summary_of([(0.01,), (0.01,)], (0.01,) * 3), "tests": []})
    assert "what practice is worth is told by --tests N" in told and "at the same" not in told


@pytest.mark.parametrize(("tests", "purposes"), [
    (2, ["before practice", "practised", "after practice"]),
    (3, ["before practice", "practised", "after the change", "practised", "after practice"]),
])  # fmt: skip
def test_every_throw_has_its_purpose_in_order_of_time(tests, purposes):
    summary = summary_of([(0.01, 0.02)] * tests, (0.03, 0.04, 0.05))
    phases = practice.phases_of(summary)
    assert [phase.name for phase, _ in phases] == purposes
    assert [phase.throws for phase, _ in phases] == [len(rows) for _, rows in phases]
    assert [row for phase, rows in phases if phase.learned_from for row in rows] == summary[
        "throws"
    ]


class Coach:
    """Stands for a graph that runs: remembers what was asked for, and each throw is 1 cm off."""

    def __init__(self, name="throw", simulated=False):
        self.asked, self._name, self._simulated = [], name, simulated

    def skill(self, _):
        return self._name

    def is_simulated(self, _):
        return self._simulated

    def practise(self, throws, only_throw=False, on_feedback=None, **where):
        self.asked.append((throws, only_throw, where))
        situation = conversions.at_place(np.array([2.0, 0.0, 0.4]))
        outcome = conversions.unseen_outcome_msg(situation, self._name, "world")
        return Practice.Result(
            success=True,
            executed=throws,
            learned=0 if only_throw else throws,
            outcomes=[outcome] * throws,
        )


@pytest.mark.parametrize(("chosen", "where"), [
    ([], {"follow_basket": True}), (["--at", "2", "0", "0.4"], {"targets": [[2.0, 0.0, 0.4]]}),
])  # fmt: skip
def test_on_a_running_graph_there_are_tests_only_if_somebody_asks_for_them(chosen, where):
    parser = argparse.ArgumentParser()
    practice.add_arguments(parser)
    for tests, wanted in (
        ([], [(4, False, where)]),
        (["--tests", "2"], [(2, True, where), (4, False, where), (2, True, where)]),
    ):
        coach = Coach()
        told = practice.practise_there(
            coach, parser.parse_args(["--running", "--throws", "4", *chosen, *tests])
        )
        assert coach.asked == wanted and told["thrown"] == 4
        assert ("at the same 2 baskets" in told["text"]) == bool(tests)


@pytest.mark.parametrize(
    ("name", "simulated", "chosen", "follows"),
    [
        ("place", False, [], True),
        ("place", False, ["--choose"], False),
        ("place", True, [], False),
        ("darts", False, [], False),
    ],
)
def test_beside_a_real_arm_nobody_carries_bodies_about_unless_they_ask_for_it(
    name, simulated, chosen, follows
):
    parser, coach = argparse.ArgumentParser(), Coach(name, simulated)
    practice.add_arguments(parser)
    practice.practise_there(coach, parser.parse_args(["--running", "--throws", "2", *chosen]))
    assert coach.asked == [(2, False, {"follow_basket": follows})]


@pytest.mark.parametrize(
    ("name", "looks"), [("throw", False), ("darts", False), ("place", True), ("reach", True)]
)
def test_a_trial_is_planned_for_what_the_cameras_see_where_it_depends_on_bodies(
    name, looks, capsys
):
    """A basket is where it was put, and a board hangs where it hangs."""
    asked, skill = [], load_skill(name)

    class Graph:
        def execute(self, situation, look):
            asked.append(look)
            outcome = conversions.unseen_outcome_msg(situation, name, "world")
            return Execute.Result(
                code=Execute.Goal.OUTCOME_REFUSED,
                message="nothing is learned yet",
                outcome=outcome,
            )

    results = try_all(Graph(), skill, skill.situations(0, 0, 2)[1], 2)
    assert (
        asked == [looks] * 2 and [one.message for one in results] == ["nothing is learned yet"] * 2
    )
    said = capsys.readouterr().err.splitlines()
    assert said[1].startswith(f"{name} 2/2: ") and "nothing is learned yet" in said[1]
    assert ": no t" in said[1], "no throw, no trial"
