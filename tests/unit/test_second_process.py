"""A second process of our own: results, errors, and how it ends."""

import os
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest

from dart_skill.recording import BagError
from dart_skill.second_process import called, load, second_process

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
needs_two_cores = pytest.mark.skipif(CORES < 2, reason="one core")


def doubled(values):
    return 2.0 * values


def refuse(text):
    raise BagError(text)


def say(text):
    print(text)
    return os.getpid()


def is_there(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_results_are_given_when_they_are_wanted_in_any_order():
    values = np.arange(1e6)  # 8 MB: more than a pipe takes
    with second_process() as begin:
        first, second = begin(doubled, values), begin(doubled, values[:3])
        np.testing.assert_array_equal(second(), [0.0, 2.0, 4.0])
        np.testing.assert_array_equal(first(), 2.0 * values)
        np.testing.assert_array_equal(first(), 2.0 * values)


def test_two_processes_that_both_send_much_do_not_wait_for_each_other():
    values = np.ones(1_000_000)
    with second_process() as begin:
        answers = [begin(doubled, values) for _ in range(3)]
        assert [answer().sum() for answer in answers] == [2e6] * 3


@needs_two_cores
def test_it_is_another_process_whose_words_do_not_disturb_the_results(capfd):
    with second_process() as begin:
        pid = begin(say, "said there")()
        assert pid != os.getpid() and is_there(pid)
    assert not is_there(pid)
    said = capfd.readouterr()
    assert said.out == "" and said.err == "said there\n"


def test_an_error_is_raised_where_the_result_is_asked_for():
    with second_process() as begin:
        refused, other = begin(refuse, "no such bag"), begin(doubled, 2.0)
        with pytest.raises(BagError, match="^no such bag$"):
            refused()
        assert other() == 4.0


@needs_two_cores
def test_a_process_that_ends_by_itself_is_told():
    with second_process() as begin:
        ended = begin(os.kill, begin(os.getpid)(), signal.SIGKILL)
        with pytest.raises(OSError, match="second process of this command ended with status -9"):
            ended()
        with pytest.raises(OSError, match="ended with status -9"):
            begin(doubled, np.ones(1_000_000))


@needs_two_cores
@pytest.mark.parametrize("threads", [0, 1])
def test_it_is_a_copy_of_a_process_without_threads_and_else_a_new_one(threads):
    script = (
        "import sys, threading, time; from dart_skill.second_process import called, second_process; sys.marked = True\n"
        f"for _ in range({threads}): threading.Thread(target=time.sleep, args=(3.0,), daemon=True).start()\n"
        "with second_process() as begin: print(begin(called, 'builtins:eval', \"hasattr(__import__('sys'), 'marked')\")())"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert said.strip() == str(not threads)


@needs_two_cores
def test_a_small_question_waits_for_no_answer():
    with second_process() as begin:
        begin(called, "builtins:abs", -1)()
        begun = time.monotonic()
        slow, quick = begin(time.sleep, 2.0), begin(called, "builtins:abs", -3)
        assert time.monotonic() - begun < 1.5
        assert quick() == 3 and slow() is None


def test_with_one_core_this_process_does_it(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)
    with second_process() as begin:
        assert begin is partial and begin(os.getpid)() == os.getpid()


def test_what_cannot_be_imported_is_left_to_whoever_wants_it():
    load(["json:loads", "no_such_package", "json"])


@needs_two_cores
def test_it_ends_with_a_process_that_was_killed():
    """Nobody is there to end it then: nobody asks any more."""
    script = (
        "import os, time; from dart_skill.second_process import second_process\n"
        "with second_process() as begin:\n    print(begin(os.getpid)(), flush=True); time.sleep(60.0)"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as asking:
        pid = int(asking.stdout.readline())
        asking.kill()
    until = time.monotonic() + 20.0
    while is_there(pid):
        assert time.monotonic() < until, "an orphan goes on"
        time.sleep(0.05)
