"""What the project computes, as a table of exact numbers: models, plans and landings of a few
seeds, in process.

    python3 -m tests.reference.results tests/reference/results.json      # writes the table anew, where results were meant to change

Numbers are written as hexadecimal floats, so that equal text means equal to the last bit. The sums
of another processor or another version of NumPy differ in the last bits; `fingerprint` tells
whether this machine computes as the one did on which the table was made.
"""

import hashlib
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import scipy.linalg
from scipy.spatial.transform import Rotation

from dart_skill.arm import MotionPlan
from dart_skill.common.regions import targets_for
from dart_skill.experiments.studies import arm_darts, practice
from dart_skill.recording import read_demonstrations
from dart_skill.session import Session
from dart_skill.skills.learning import ThrowingSkill, Unreachable, configuration, learn_throwing
from tests.paths import BAGS

MODELS = (
    "default",
    "intervals",
    "em",
    "two_frames",
    "thesis",
    "weighted",
    "autonomous",
    "shown_release",
)
THROWERS = ("intervals", "default")
SHOWN, THROWN = 5, 2


def fingerprint() -> str:
    """Digest of sums, products, factorisations and elementary functions as this machine computes
    them.
    """
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(64, 64)), rng.normal(size=(64, 1000))
    spd = a @ a.T + 64 * np.eye(64)
    parts = [
        a @ b,
        spd,
        np.linalg.inv(a),
        np.linalg.eigh(spd)[1],
        np.linalg.svd(a)[0],
        scipy.linalg.cholesky(spd),
        b.sum(axis=1),
    ]
    parts += [f(b) for f in (np.sin, np.cos, np.exp, np.arctan, np.tanh)] + [
        np.log(np.abs(b)),
        np.hypot(b[0], b[1]),
    ]
    parts += [np.einsum("ij,jk->ik", a, b), Rotation.from_rotvec(b[:3].T).as_quat()]
    digest = hashlib.sha256(
        f"{sys.version_info[:2]} {np.__version__} {pinocchio.__version__}".encode()
    )
    for part in parts:
        digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()[:16]


def exact(values) -> list[str]:
    """Numbers as text from which every bit of them can be read."""
    return [float(value).hex() for value in np.ravel(values)]


def digest_of(plan: MotionPlan) -> str:
    """Digest of every number of a plan, whatever its configuration is called."""
    path, gains = plan.path, (plan.position_gains, plan.orientation_gains)
    digest = hashlib.sha256()
    for part in (
        plan.thrown.target, plan.thrown.aim, plan.thrown.landing, path.time,
        path.position, path.quaternion, path.velocity, path.acceleration,
        plan.attractor_position, plan.attractor_quaternion, *(value for gain in gains for value in (gain.stiffness, gain.damping)),
        plan.release, plan.open_hand, plan.start_posture,
    ):  # fmt: skip
        digest.update(np.ascontiguousarray(part, dtype=float).tobytes())
    return digest.hexdigest()[:16]


def _planned(skill: ThrowingSkill, target: np.ndarray) -> dict:
    """A plan in a few numbers, or why there is none."""
    try:
        plan = skill.plan(target)
    except Unreachable as error:
        return {"refused": str(error)}
    return {
        "digest": digest_of(plan),
        "aim": exact(plan.thrown.aim),
        "times": exact([plan.release, plan.open_hand]),
    }


def throws_of(seed: int) -> dict:
    """Lessons, the models that several configurations learn from them, their plans, and throws of
    THROWERS, one after the other.
    """
    to_demonstrate, to_throw = targets_for(seed, SHOWN, THROWN)
    session = Session(seed)
    try:
        lessons = [session.teach(target) for target in to_demonstrate]
        skills = {
            name: learn_throwing(
                [lesson[-1].demonstration for lesson in lessons], configuration(name)
            )
            for name in MODELS
        }
        plans = {name: _planned(skill, to_throw[0]) for name, skill in skills.items()}
        landings = {
            name: [session.throw(skills[name].plan(target)).outcome.landing for target in to_throw]
            for name in THROWERS
        }
    finally:
        session.close()
    return {
        "lessons": [exact(lesson[-1].outcome.landing) for lesson in lessons],
        "attempts": [len(lesson) for lesson in lessons],
        "models": {name: skill.model_id for name, skill in skills.items()},
        "plans": plans,
        "landings": {name: [exact(landing) for landing in its] for name, its in landings.items()},
    }


def practice_of(seed: int) -> dict:
    """Own throws that are learned from, with each of THROWERS: their errors, and those of test
    throws afterwards.
    """
    much = {"demonstrations": 3, "throws": 4, "tested_after": [4], "tests": 2}
    tasks = {name: practice.practice_task(seed, configuration=name, **much) for name in THROWERS}
    done = {name: practice.run(task) for name, task in tasks.items()}
    return {
        name: {"errors": exact(one["errors"]), "test_errors": exact(one["test_errors"])}
        for name, one in done.items()
    }


def darts_of(seed: int) -> dict:
    """Darts of the arm at a board, with each of THROWERS; aims other than the bull begin with the
    eleventh.
    """
    throws = {"intervals": 2, "default": 12}
    darts = {
        name: arm_darts.run(seed, throws=throws[name], demonstrations=3, name=name).darts
        for name in THROWERS
    }
    return {
        name: {
            "hits": [exact(dart.hit) for dart in its],
            "aims": [exact(dart.aim) for dart in its],
        }
        for name, its in darts.items()
    }


def bags_of(seed: int) -> dict:
    """What the bags of the repository teach; the seed is of no account."""
    demonstrations = read_demonstrations(BAGS / "demonstrations")
    models = {
        name: learn_throwing(demonstrations, configuration(name))
        for name in ("default", "intervals", "em")
    }
    fewer = learn_throwing(demonstrations[:4], replace(configuration("intervals"), name="fewer"))
    return {
        "models": {name: skill.model_id for name, skill in models.items()},
        "plans": {
            name: _planned(skill, np.array([1.9, 0.2, 0.4]))
            for name, skill in {**models, "fewer": fewer}.items()
        },
    }


PARTS = {"throws": throws_of, "practice": practice_of, "darts": darts_of, "bags": bags_of}
ENTRIES = [
    ("throws", 0),
    ("throws", 1),
    ("throws", 7),
    ("practice", 0),
    ("practice", 3),
    ("darts", 0),
    ("bags", 0),
]


def main() -> None:
    """Write the table to the file that the command line names."""
    table = {
        "fingerprint": fingerprint(),
        **{f"{part} {seed}": PARTS[part](seed) for part, seed in ENTRIES},
    }
    Path(sys.argv[1]).write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
