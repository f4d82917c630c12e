"""A skill that has practised, saved and loaded: it plans, explores and learns as the one that was
saved, to the last bit.
"""

import json
from copy import deepcopy

import numpy as np
import pytest

from dart_skill.arm import same_plan
from dart_skill.common.regions import targets_for
from dart_skill.session import Session
from dart_skill.skills.learning import load_model, save_model
from dart_skill.skills.practice import PractisingSkill, practised_skill, save_practised

NEW = np.array([1.95, 0.2, 0.4])
_, TARGETS = targets_for(3, 1, 9)


@pytest.fixture(scope="module")
def session():
    session = Session(seed=11)
    yield session
    session.close()


def practise(session, skill, targets):
    for target in targets:
        plan = skill.plan(target, explore=True)
        skill.tell(plan, session.throw(plan).demonstration)


@pytest.fixture(scope="module")
def practised(session, demonstrations):
    """Makes skills that have practised by a method for so many throws, which are thrown once."""
    known = {}

    def one(method, throws):
        if (method, throws) not in known:
            known[method, throws] = PractisingSkill(demonstrations, method=method)
            practise(session, known[method, throws], TARGETS[:throws])
        return deepcopy(known[method, throws])

    return one


@pytest.mark.parametrize(
    "method, throws",
    [
        ("residual", 2),
        pytest.param("both", 2, marks=pytest.mark.slow),
        ("bootstrap", 2),
        ("power", 6),
        ("none", 1),
    ],
)
def test_a_loaded_skill_goes_on_to_the_last_bit(session, practised, tmp_path, method, throws):
    """It plans the same, explores the same, and has learned the same after the next throw."""
    skill = practised(method, throws)
    save_practised(tmp_path / "throw.npz", skill)
    loaded = practised_skill(load_model(tmp_path / "throw.npz"), method)
    assert loaded.practised == skill.practised == throws
    assert same_plan(loaded.plan(NEW), skill.plan(NEW))
    plans = [each.plan(TARGETS[throws], explore=True) for each in (skill, loaded)]
    assert same_plan(*plans)
    trial = session.throw(plans[0]).demonstration
    for each, plan in zip((skill, loaded), plans, strict=True):
        each.tell(plan, trial)
    assert same_plan(loaded.plan(NEW), skill.plan(NEW))
    assert json.dumps(loaded.state()) == json.dumps(skill.state())


@pytest.fixture(scope="module")
def searched(practised):
    """A skill whose PoWER has begun to explore."""
    skill = practised("power", 6)
    assert (skill.search.spread > 0.0).all()
    return skill


@pytest.mark.slow
def test_what_power_found_is_used_by_whoever_loads_it_but_for_one_who_wants_none(
    searched, tmp_path
):
    save_practised(tmp_path / "throw.npz", searched)
    saved = load_model(tmp_path / "throw.npz")
    for method in ("residual", "both", "bootstrap"):
        loaded = practised_skill(saved, method)
        assert loaded.method == "power" and same_plan(loaded.plan(NEW), searched.plan(NEW))
    without = practised_skill(saved, "none")
    assert without.method == "none" and not same_plan(without.plan(NEW), searched.plan(NEW))


def test_the_release_of_darts_stays_where_practice_moved_it(searched, tmp_path):
    """As state: 100 darts would take too long here."""
    found = searched.state() | {
        "release_shift": 0.004,
        "steadied": [2, [2.0, 0.1, 0.4], 0.004, [0.01, 0.02]],
    }
    found = json.loads(json.dumps(found))
    searched_again = practised_skill(
        load_model(_saved(tmp_path, searched))._replace(found=found), "power"
    )
    assert (
        searched_again.release_shift == 0.004
        and searched_again.state()["steadied"] == found["steadied"]
    )


def _saved(folder, skill):
    save_practised(folder / "again.npz", skill)
    return folder / "again.npz"


def test_a_file_from_before_this_was_saved_is_read_as_it_was(practised, demonstrations, tmp_path):
    """Then the misses alone were kept."""
    skill = practised("residual", 2)
    save_model(
        tmp_path / "older.npz", demonstrations, skill.skill.configuration, skill.correction.throws
    )
    loaded = practised_skill(load_model(tmp_path / "older.npz"))
    np.testing.assert_array_equal(loaded.correction.shifted(NEW), skill.correction.shifted(NEW))
    assert loaded.practised == 0 and len(loaded.practice.demonstrations) == len(demonstrations)


@pytest.mark.parametrize(
    "change",
    [
        {"n_shown": 99},
        {"n_told": None},
        {"hand": 3},
        {"steadiness": [[1.0]]},
        {"steadied": [1]},
        {"search": {}},
        {"search": {"seen": [], "generator": {"bit_generator": "Dice"}, "search": None}},
    ],
)
def test_damaged_findings_are_refused(searched, tmp_path, change):
    saved = load_model(_saved(tmp_path, searched))
    with pytest.raises(ValueError, match="what practice found is damaged"):
        practised_skill(saved._replace(found={**saved.found, **change}), "power")


def test_findings_that_are_no_object_are_refused(searched, tmp_path):
    with np.load(_saved(tmp_path, searched)) as archive:
        content = dict(archive)
    np.savez_compressed(tmp_path / "bad.npz", **{**content, "found": np.array("[1, 2]")})
    with pytest.raises(ValueError, match="no object of JSON but list"):
        load_model(tmp_path / "bad.npz")
