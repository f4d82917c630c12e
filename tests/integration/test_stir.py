"""A skill that repeats through the nodes: shown by a simulated person, learned from one demonstration,
carried out at the frequency that is asked for.
"""

import numpy as np
import pytest

from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from tests.integration.conftest import graphs

SEED = 0


@pytest.fixture(scope="module")
def trial(ros, tmp_path_factory):
    """What was asked for, and what came of it."""
    skill, rng = load_skill("stir"), np.random.default_rng([SEED, 7])
    with graphs(tmp_path_factory.mktemp("stir")) as make:
        _, client = make("composed", SEED, skill="stir")
        lesson = client.show(conversions.situation_msg(skill.draw(rng)))
        assert lesson.success, lesson.message
        client.learn()
        asked = skill.draw(rng, wide=True)
        yield asked, client.execute(conversions.situation_msg(asked), look=True)


@pytest.mark.slow
def test_the_numbers_that_are_asked_for_reach_the_plan_and_the_judge(trial):
    """They were lost where the bodies are looked at: the arm stirred as it was shown."""
    asked, made = trial
    judged = conversions.situation(made.outcome.situation)
    assert judged.numbers == pytest.approx(asked.numbers)
    assert made.outcome.success, made.outcome.reason
