"""What a soak samples, and what it says of that."""

import os
import time
from dataclasses import replace

import pytest
from dart_skill_msgs.action import Practice
from dart_skill_msgs.msg import Outcome

from dart_skill_nodes.process.graph_processes import GraphFailure
from tests.benches import soak
from tests.benches.soak.samples import Sample, Usage, changes

WARM_UP = 10.0
STEADY = [
    Sample(
        float(k),
        10 * k,
        2.0,
        {"composed": Usage(300.0, 0.3, 20, 19), "learner": Usage(200.0, 0.1, 9, 12)},
    )
    for k in range(1, 41)
]


def changed(**of_last_half):
    """Samples whose second half differs in what the composed process uses, or in speed."""
    speed, usage = (
        of_last_half.pop("speed", 2.0),
        replace(STEADY[0].usage["composed"], **of_last_half),
    )
    return [
        *STEADY[:20],
        *(
            replace(one, speed=speed, usage={**one.usage, "composed": usage})
            for one in STEADY[20:]
        ),
    ]


@pytest.mark.parametrize(
    "samples, said",
    [
        (STEADY, []),
        (changed(memory=314.0), []),
        (changed(memory=330.0), ["the memory of composed grew by 10 %"]),
        (changed(threads=21), ["composed has 21 threads, it had 20"]),
        (changed(descriptors=25), ["composed has 25 descriptors, it had 19"]),
        (changed(speed=1.8), ["the loop makes 90 % of the speed that it had"]),
        (changed(processor=0.34), ["the loop needs 110 % of the processor time that it needed"]),
    ],
)
def test_what_changed_after_the_warm_up_is_said(samples, said):
    assert changes(samples, WARM_UP) == said


def test_a_soak_that_was_too_short_says_so():
    with pytest.raises(ValueError, match="0 rounds after 50 min of warm-up"):
        changes(STEADY, 50.0)


class Client:
    """Throws ten times while the processor works for 30 ms; each takes 2 s of the world's time.
    fails_after: so many rounds.
    """

    def __init__(self, fails_after=10**6):
        self.rounds, self.fails_after = 0, fails_after

    def practise(self, throws):
        until = time.process_time() + 0.03
        while time.process_time() < until:
            pass
        self.rounds += 1
        result = Practice.Result(
            success=self.rounds <= self.fails_after, message="the arm is stopped", executed=throws
        )
        result.outcomes = [Outcome() for _ in range(throws)]
        result.outcomes[-1].header.stamp.sec = 20 * self.rounds
        return result


def test_a_soak_looks_at_its_processes_after_each_round():
    samples = list(soak.practise(Client(), {"this": os.getpid()}, minutes=0.001))
    assert [one.thrown for one in samples] == list(range(20, 20 + 10 * len(samples), 10))
    assert samples[-1].minutes >= 0.001 and all(one.speed > 1.0 for one in samples)
    usage = samples[-1].usage["this"]
    assert sum(one.usage["this"].processor for one in samples) > 0.0
    assert 20.0 < usage.memory < 5000.0 and usage.threads >= 1 and usage.descriptors >= 3


def test_a_soak_ends_when_the_graph_throws_no_more():
    with pytest.raises(GraphFailure, match="the arm is stopped"):
        list(soak.practise(Client(fails_after=2), {}, minutes=60.0))
