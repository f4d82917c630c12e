"""A spoon in a pot: shown once, carried out elsewhere, at another frequency, and with a hand that is
held.
"""

import numpy as np
import pytest

from dart_skill.experiments.studies.stirring import StirTrial, stir_seed, stir_table
from dart_skill.session import BenchSession, carrier_of
from dart_skill.simulation import Carrier, Stirrer
from dart_skill.skills.protocol import load_skill


@pytest.mark.slow
def test_a_pot_that_stands_elsewhere_is_stirred_and_a_hand_that_was_held_comes_back():
    free, held = stir_seed(41, pots=1, held=1)
    assert free.success and free.error < 0.004 and free.off < 0.02, free
    assert free.starts < 0.02 and free.stops < 0.02, "no jump"
    assert held.success and held.error < 0.006 and held.crept < 0.15, held


def test_a_person_is_chosen_by_how_a_skill_is_shown():
    assert type(carrier_of(load_skill("place"), 0)) is Carrier
    assert isinstance(carrier_of(load_skill("stir"), 0), Stirrer)
    with pytest.raises(ValueError, match="'reach' is shown by 'follow'"):
        carrier_of(load_skill("reach"), 0)


def test_the_session_has_the_bodies_of_the_skill():
    session = BenchSession(load_skill("stir"), seed=1)
    seen = session.situation(session.skill.draw(np.random.default_rng(0)).pose("pot"))
    assert set(seen.poses) == {"spoon", "pot"}
    session.close()


def test_the_table_tells_what_failed():
    good = StirTrial(0, "free", 0.5, True, "", 0.002, 0.01, 0.001, 0.002)
    bad = StirTrial(3, "held", 0.7, False, "it did not come back to its circle")
    said = stir_table([good, bad])
    assert "1 of 1 pots are stirred as asked\n2.0 (at worst 2.0) mm from the circle" in said
    assert "0 of 1 come back" in said
    assert said.endswith("seed 3, held, 0.70 /s: it did not come back to its circle")
