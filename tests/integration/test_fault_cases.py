"""Some cases of `dart-skill experiment faults`: something is hurt on one graph, which has to work
again each time.
"""

from contextlib import closing

import pytest

from dart_skill.cli import main
from tests.benches.faults.bench import Bench
from tests.benches.faults.cases import CASES, FAULTS, OF_ATTACKS, PHASES, named
from tests.benches.faults.reactions import Reaction, as_json, page
from tests.benches.faults.small_disk import SmallDisk
from tests.benches.faults.stranger import ATTACKS
from tests.integration.conftest import RUNNING

ON_A_BUSY_MACHINE = 60.0
"""For an answer [s, wall clock]: docs/faults.md has what is measured on one that has nothing else
to do.
"""
CHEAP = (
    "kill_wam_simulator_swing",
    "kill_skill_learner_planning",
    "freeze_commander_lesson",
    "hold_up_commander_swing",
    "full_disk_demonstration_recorder_practice",
    "attack_strong_commands_swing",
    "attack_reversed_states_swing",
    "attack_garbage_swing",
    "attack_guided_reset_lesson",
    "duplicate_command_swing",
    "corrupt_command_swing",
    "lose_command_swing",
)


@pytest.fixture(scope="module")
def bench(ros, tmp_path_factory):
    """The graph, taught, with a client that no fault surprises."""
    folder = tmp_path_factory.mktemp("bench")
    RUNNING.append(folder)
    with closing(Bench(folder, extra=(), speed=0.0)) as bench:
        bench.start()
        yield bench
    RUNNING.remove(folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", CHEAP)
def test_the_client_is_told_the_arm_rests_and_all_works_again(bench, name):
    (case,) = named(name)
    reaction = bench.run(case)
    assert not reaction.faults(bench.usual, ON_A_BUSY_MACHINE), reaction


def test_the_page_of_throws_is_not_written_over_with_cases_of_another_skill(tmp_path, capsys):
    page = tmp_path / "faults.md"
    with pytest.raises(SystemExit):
        main(["experiment", "faults", "--skill", "place", "--page", str(page)])
    assert "leave out --skill place, or --page" in capsys.readouterr().err and not page.exists()


def test_cases_have_names_of_their_own():
    assert len({case.name for case in CASES}) == len(CASES) >= 80
    with pytest.raises(ValueError, match="no case is called 'kill_the_cat'"):
        named("kill_the_cat")


def test_every_fault_has_cases_and_every_attack_too():
    assert {case.fault for case in CASES} == set(FAULTS) and {case.phase for case in CASES} == set(
        PHASES
    )
    assert {what for of in OF_ATTACKS.values() for what in of} == set(ATTACKS)


def test_a_small_disk_is_full_when_it_is_filled_and_then_free_again(tmp_path):
    disk = SmallDisk(tmp_path / "disk")
    if not disk.is_real:
        pytest.skip("mounting a file system needs the rights for it")
    with closing(disk):
        disk.fill(0)
        with pytest.raises(OSError, match="No space"):
            (disk.folder / "bag").write_bytes(bytes(5000))
        disk.free()
        (disk.folder / "bag").write_bytes(bytes(5000))
    assert not (tmp_path / "disk" / "bag").exists()


def reaction(**changes):
    """One that is as it must be, but for changes."""
    (case,) = named("kill_commander_swing")
    fields = {
        "succeeded": False,
        "answer": "commander has gone",
        "seconds": 4.0,
        "fastest": 3.0,
        "strongest": 20.0,
        "last": 0.0,
    }
    fields |= {"pushed": (), "at_once": False, "bag": "", "afterwards": "", "within": 9.0}
    return Reaction(case, **(fields | changes))


@pytest.mark.parametrize(
    "changes, said",
    [
        ({}, ""),
        ({"seconds": 6.0}, "answered after 6.0 s"),
        ({"answer": "no answer"}, "does not name the cause"),
        ({"fastest": 9.0}, "9.0 rad/s"),
        ({"strongest": 99.0}, "99 Nm"),
        ({"last": 1.0}, "still moves at 1.00 rad/s"),
        ({"at_once": True}, "pushed at once"),
        ({"bag": "its bag is not whole"}, "its bag is not whole"),
        ({"afterwards": "does not work again: x"}, "does not work again: x"),
    ],
)
def test_what_is_wrong_is_said(changes, said):
    one, usual = reaction(**changes), (4.0, 60.0)
    wrong = one.faults(usual)
    assert len(wrong) == bool(said) and said in "".join(wrong)
    assert (said or "| ok |") in page([one], usual)
    assert as_json(one, usual)["wrong"] == wrong
