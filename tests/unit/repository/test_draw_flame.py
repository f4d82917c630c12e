"""The flame graph of docs/performance.md: stacks that py-spy wrote become boxes of the right
width, below the right node.
"""

import importlib.util

import pytest

from tests.paths import ROOT

spec = importlib.util.spec_from_file_location("draw_flame", ROOT / "tools" / "draw_flame.py")
draw_flame = importlib.util.module_from_spec(spec)
spec.loader.exec_module(draw_flame)

BELOW = (
    "thread (1): MainThread;run (dart_skill_nodes/process/node_base.py:148);spin_until"
    " (dart_skill_nodes/process/node_base.py:163)"
)
STEP = (
    f"{BELOW};WamSimulator._step (dart_skill_nodes/executables/wam_simulator.py:200);Plant.step"
    " (dart_skill/simulation/_plant.py"
)
SAMPLES = f"""\
{STEP}:80);0x7fc81364524a (libc.so.6);pybullet_stepSimulation (pybullet.so) 30
{STEP}:81) 10
{BELOW};CommanderNode._answer (dart_skill_nodes/executables/commander.py:180) 40
{BELOW};rcl_publish (librcl.so) 20
{BELOW};pthread_cond_timedwait (libc.so.6) 900
thread (1): MainThread;run (dart_skill_nodes/process/node_base.py:141);_started (dart_skill_nodes/process/node_base.py:174) 500
"""


def test_a_box_is_as_wide_as_its_share_of_the_samples_and_has_the_colour_of_its_node():
    found = {box.name: box for box in draw_flame.boxes(draw_flame.stacks_of(SAMPLES))}
    shares = {
        name: (pytest.approx(box.share), box.depth, box.kind[0]) for name, box in found.items()
    }
    assert shares == {
        "WamSimulator._step": (0.4, 0, "simulator"),
        "Plant.step": (0.4, 1, "simulator"),
        "pybullet_stepSimulation": (0.3, 2, "simulator"),
        "CommanderNode._answer": (0.4, 0, "commander"),
        "rcl_publish": (0.2, 0, "executor and middleware"),
    }
    starts = sorted((box.start, box.share) for box in found.values() if box.depth == 0)
    assert [start for start, _ in starts] == pytest.approx(
        [0.0, *(start + share for start, share in starts[:-1])]
    )


def test_the_key_says_the_share_of_each_node_and_leaves_the_rest_to_the_executor():
    key = draw_flame.key_of(draw_flame.boxes(draw_flame.stacks_of(SAMPLES)))
    assert sorted(patch.get_label() for patch in key) == [
        "commander, 40%",
        "executor and middleware, 20%",
        "simulator, 40%",
    ]


def test_samples_of_another_process_are_refused():
    with pytest.raises(SystemExit, match="no stack holds 'spin_until"):
        draw_flame.stacks_of("thread (1): MainThread;main (other.py:3) 7\n")
