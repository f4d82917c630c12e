"""The bag of a session, with the topics of the graph's recorder. Needs no ROS."""

from dataclasses import fields, is_dataclass, replace

import numpy as np

from dart_skill.recording import demonstration_id
from dart_skill.session import Session, SessionBag
from dart_skill.skills.learning import learn_throwing
from dart_skill.skills.protocol import load_skill

GIGA = 1_000_000_000


def header(stamp_ns, frame_id="world"):
    """A header's content."""
    sec, nanosec = divmod(int(stamp_ns), GIGA)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame_id}


def as_published(one):
    """A demonstration with the id that the recorder gives it."""
    return replace(one, id=demonstration_id(one.stamp_ns + round(1e9 * one.opened)))


def same(one, other, names=None):
    """Names of the fields in which two dataclasses of arrays differ in any bit."""
    names = names or [item.name for item in fields(one)]
    return [name for name in names if not _equal(getattr(one, name), getattr(other, name))]


def _equal(one, other):
    if is_dataclass(one):
        return same(one, other) == []
    if isinstance(one, dict):
        return list(one) == list(other) and all(_equal(one[key], other[key]) for key in one)
    return np.array_equal(np.asarray(one), np.asarray(other))


TAUGHT = np.array([[1.80, -0.60, 0.40], [2.00, 0.10, 0.40], [2.15, 0.70, 0.40]])
THROWN_AT = np.array([1.95, 0.15, 0.40])


def record(folder):
    """A bag with three guided throws and one of the arm's own: its path, the guided trials, the
    own trial.
    """
    path = folder / "recorded"
    with SessionBag(path, 3, load_skill("throw")) as bag:
        session, taught = Session(seed=3, bag=bag), []
        for target in TAUGHT:
            taught += session.teach(target, attempts=1)
            bag.keep_throw(taught[-1].demonstration, session.plant.state_stamp_ns)
        shown = [trial.demonstration for trial in taught]
        own = session.throw(learn_throwing(shown).plan(THROWN_AT))
        session.close()
    return path, taught, own
