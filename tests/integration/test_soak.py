"""What a soak says of its samples."""

from dataclasses import replace

import pytest

from dart_skill_nodes.verbs.soak.samples import Sample, Usage, changes

WARM_UP = 10.0
STEADY = [Sample(float(k), 10 * k, 2.0, {"composed": Usage(300.0, 20, 19), "learner": Usage(200.0, 9, 12)}) for k in range(1, 41)]


def changed(**of_last_half):
    """Samples whose second half differs in what the composed process uses, or in speed."""
    speed, usage = of_last_half.pop("speed", 2.0), replace(STEADY[0].usage["composed"], **of_last_half)
    return [*STEADY[:20], *(replace(one, speed=speed, usage={**one.usage, "composed": usage}) for one in STEADY[20:])]


@pytest.mark.parametrize(
    "samples, said",
    [
        (STEADY, []),
        (changed(memory=314.0), []),
        (changed(memory=330.0), ["the memory of composed grew by 10 %"]),
        (changed(threads=21), ["composed has 21 threads, it had 20"]),
        (changed(descriptors=25), ["composed has 25 descriptors, it had 19"]),
        (changed(speed=1.8), ["the loop makes 90 % of the speed that it had"]),
    ],
)
def test_what_changed_after_the_warm_up_is_said(samples, said):
    assert changes(samples, WARM_UP) == said


def test_a_soak_that_was_too_short_says_so():
    with pytest.raises(ValueError, match="0 rounds after 50 min of warm-up"):
        changes(STEADY, 50.0)
