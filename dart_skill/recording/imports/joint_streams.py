"""The arm's joint states out of all that was published on their topic: by gripper, other arm and
twin as well as by the arm.

Each message is read by its own names (`joint_layout`). Messages that are laid out alike are one
voice. Those that name the arm's joints are taken; where two voices contradict each other, it must
be clear which one is the arm's, or a mapping says it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from dart_skill.common.arm_choice import joint_count
from dart_skill.common.world import joint_names
from dart_skill.recording.bags import BagMessage, columns_by_layout
from dart_skill.recording.imports.faults import NOTE, Fault
from dart_skill.recording.imports.mapping import ANGLE_UNITS, SignalSource
from dart_skill.recording.signals import JointLayout, joint_layout

JOINTS = "joints"
"""What the arm's joints are called in faults and in a mapping."""
APART = 0.02
"""Positions that are farther apart are not the same: of an arm that moves less than a radian
[rad], else of its range.
"""
AT_ONCE_NS = 250_000_000
"""Messages that are nearer to each other in time can be compared [ns]."""
SILENCE_NS = 1_000_000_000
"""Shortest silence of a voice after which another one may have replaced it [ns]."""
OFTEN = 10
"""Fewest leaps away and back that tell of a second publisher."""
STRETCH_NS = 500_000_000
"""Longest silence over which speeds are taken [ns]."""
COLUMNS = ("stamp_ns", "log_ns", "position", "velocity")
"""Names of the arrays of `JointStream`."""
MOVES = 0.01
"""Smallest range of the positions of a joint that has moved [rad]."""
_APART = "messages of their own"
"""Where joints are that are put together, as it is told."""


@dataclass(frozen=True, eq=False)
class JointStream:
    """The arm's own sensors, in the order of recording.

    Parameters
    ----------
    stamp_ns
        (n,) [ns].
    position
        (n, 7) [rad].
    velocity
        (n, 7) [rad/s]; nan where they were not recorded.
    names
        Of the joints; may be empty.
    log_ns
        When they were recorded (n,) [ns]; empty where that is not known.
    faults
        What else was on the topic, and what is wrong.
    """

    stamp_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    names: tuple[str, ...] = ()
    log_ns: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    faults: tuple[Fault, ...] = ()

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def take(self, index: np.ndarray) -> JointStream:
        """The rows of an index array or mask."""
        return replace(self, **{name: getattr(self, name)[index] for name in COLUMNS})


@dataclass(frozen=True, eq=False)
class _Voice:
    """Messages of one topic that are laid out alike.

    * names: of all joints that they name; n_velocities: how many of those they have; frame: of
      their header.
    * first: place of the first of them among all messages; stamp_ns, log_ns: (n,).
    * position, velocity: (n, k).
    """

    names: tuple[str, ...]
    n_velocities: int
    frame: str
    first: int
    stamp_ns: np.ndarray
    log_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray

    def layout(self, wanted: tuple[str, ...]) -> JointLayout:
        return joint_layout(self.names, self.position.shape[1], self.n_velocities, wanted)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def __str__(self) -> str:
        names = _listed(self.names) if self.names else "no joint by name"
        speeds = "" if self.n_velocities else ", no velocities"
        frame = f", in frame {self.frame!r}" if self.frame else ""
        return f"{len(self)} messages that list {names}{speeds}{frame}"


def read_states(
    messages: Sequence[BagMessage],
    types: Any,
    decode: Callable[[BagMessage], Any],
    where: SignalSource,
    stamp_of: Callable[[Any], int],
) -> JointStream:
    """The arm's joint states among the messages of a topic.

    Parameters
    ----------
    messages
        Of the topic, in the order of recording.
    types
        That know them.
    decode
        A message that has to be read by itself.
    where
        Names the joints that are meant, if they are not those of config/wam.yaml, and the voice.
    stamp_of
        Stamp of a decoded message [ns].

    Raises
    ------
    ValueError
        Says what was seen where it is not clear which joints are the arm's.
    """
    voices = _voices(messages, types, decode, stamp_of, ANGLE_UNITS[where.angle])
    if not voices:
        return _no_rows(where.names)
    asked = [
        one for one in voices if where.frame in ("", one.frame) and where.listed in ((), one.names)
    ]
    if not asked:
        raise ValueError(
            f"{where.topic}: no message as the mapping describes it, only {_seen(voices)}"
        )
    namings = [where.names] if where.names else _namings(asked, where.topic)
    states, taken = _rows(asked, namings, where)
    return replace(states, faults=(*states.faults, *_of_others(voices, taken, states)))


def joint_stream(
    states: JointStream, stamps: np.ndarray, where: SignalSource
) -> tuple[JointStream, list[Fault]]:
    """The states in our angles with their velocities, and what was missing of these.

    Parameters
    ----------
    states
        As they were recorded.
    stamps
        Of each (n,) [ns].
    where
        Signs and zeros.
    """
    scale = np.array(where.signs or (1.0,) * joint_count())
    position = scale * states.position + np.array(where.zeros or (0.0,) * joint_count())
    velocity, faults = _with_speeds(stamps, position, scale * states.velocity)
    found = replace(states, stamp_ns=stamps, position=position, velocity=velocity, faults=())
    return found, faults


# what was published


def _voices(
    messages: Sequence[BagMessage],
    types: Any,
    decode: Callable[[BagMessage], Any],
    stamp_of: Callable[[Any], int],
    scale: float,
) -> list[_Voice]:
    if not messages:
        return []
    decode(messages[0])  # or it says what is wrong with it
    found, left = columns_by_layout(
        types, messages[0].type_name, [message.data for message in messages]
    )
    log_ns = np.array([message.stamp_ns for message in messages], dtype=np.int64)
    parts: dict[tuple, list[tuple]] = {}
    for columns in found:
        first = columns.example
        n, both = len(first.position), len(first.position) + len(first.velocity)
        numbers = columns.numbers[:, :n], columns.numbers[:, n:both]
        parts.setdefault(_key(first), []).append((columns.index, columns.stamps, *numbers))
    for k in left:
        one = decode(messages[k])
        rows = (np.array([numbers], dtype=float) for numbers in (one.position, one.velocity))
        parts.setdefault(_key(one), []).append(([k], [stamp_of(one)], *rows))
    voices = []
    for (names, frame, _, n_velocities), several in parts.items():
        merged = [np.concatenate(column) for column in zip(*several, strict=True)]
        index, stamps, position, velocity = (one[np.argsort(merged[0])] for one in merged)
        times = stamps.astype(np.int64), log_ns[index.astype(int)]
        values = scale * position, scale * velocity
        voices.append(_Voice(names, n_velocities, frame, int(index[0]), *times, *values))
    return sorted(voices, key=lambda voice: voice.first)


def _key(message: Any) -> tuple:
    return (
        tuple(message.name),
        message.header.frame_id,
        len(message.position),
        len(message.velocity),
    )


# which joints are meant


def _namings(voices: list[_Voice], topic: str) -> list[tuple[str, ...]]:
    """What the arm's joints are called, by falling right: as in config/wam.yaml; so with something
    before or behind; the only seven; nothing where no names were recorded.

    ValueError where several names would do as well at the same time.
    """
    ours, told = joint_names(), {name for voice in voices for name in voice.names}
    # what stands before and behind the name of the first joint wherever it is a part of another
    around = sorted(name.split(ours[0], 1) for name in told if ours[0] in name)
    variants = [tuple(f"{before}{name}{behind}" for name in ours) for before, behind in around]
    variants = [one for one in variants if set(one) <= told]
    if set(ours) <= told:
        return [ours, *(one for one in variants if one != ours)]
    sevens = {
        frozenset(voice.names): voice.names
        for voice in reversed(voices)
        if len(set(voice.names)) == joint_count()
    }
    found = variants or list(sevens.values())[::-1]
    for both in combinations(found, 2):
        times = (
            [voice.log_ns for voice in voices if set(names) <= set(voice.names)] for names in both
        )
        earlier, later = (np.sort(np.concatenate(its)) for its in times)
        if _speaks_among(later, earlier):
            lines = " or ".join(
                f"joints: {{topic: {topic}, names: [{', '.join(names)}]}}" for names in both
            )
            raise ValueError(
                f"{topic}: {_seen(voices)}: which of them is the arm? Say it in a mapping, {lines}"
            )
    if found:
        return found
    if any(not voice.names and voice.position.shape[1] == joint_count() for voice in voices):
        return [()]
    if set(ours) & told:
        return [ours]
    raise ValueError(
        f"{topic}: {_seen(voices)}: name the arm's joints in a mapping, joints: {{topic: {topic},"
        " names: [...]}"
    )


def _speaks_among(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether a publisher spoke while another one did: log times (n,) and (m,) of both, ascending
    [ns].
    """
    after = np.searchsorted(one, other)
    after = after[(after > 0) & (after < len(one))]
    return bool((one[after] - one[after - 1] < SILENCE_NS).any())


def _seen(voices: Sequence[_Voice]) -> str:
    return "; ".join(map(str, voices[:6])) + (
        f"; {len(voices) - 6} other kinds" if len(voices) > 6 else ""
    )


def _listed(names: Sequence[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (
        f" and {len(names) - most} more" if len(names) > most else ""
    )


# the rows


def _no_rows(names: tuple[str, ...]) -> JointStream:
    stamps, rows = np.empty(0, np.int64), np.empty((0, joint_count()))
    return JointStream(stamps, rows, rows, names, stamps)


def _rows(
    voices: list[_Voice], namings: list[tuple[str, ...]], where: SignalSource
) -> tuple[JointStream, list[tuple[str, ...]]]:
    """Rows of the joints that are called so, and what they are called; those of a later naming
    only where the earlier ones are silent. ValueError where there are none.
    """
    parts: list[JointStream] = []
    for names in namings:
        rows = _rows_of(voices, names, where)
        before = _merged(parts).log_ns if parts else np.empty(0, np.int64)
        is_at_once = _speaks_among(before, rows.log_ns) or _speaks_among(rows.log_ns, before)
        if not len(rows) or is_at_once:
            continue
        if parts:
            note = _note(rows, f"from here on they are called {_listed(names)}")
            rows = replace(rows, faults=(*rows.faults, note))
        parts.append(rows)
    if not parts:
        raise ValueError(_why_none(voices, namings[0] or joint_names(), where))
    return _merged(parts), [part.names for part in parts]


def _rows_of(voices: list[_Voice], names: tuple[str, ...], where: SignalSource) -> JointStream:
    """Rows of the arm's joints under some names; without a name, or where no message has one of
    them, those of messages that name nothing.
    """
    unnamed = [
        voice for voice in voices if not voice.names and voice.position.shape[1] == joint_count()
    ]
    whole = [voice for voice in voices if names and voice.layout(names).order is not None]
    if not names or not (whole or any(set(names) & set(voice.names) for voice in voices)):
        whole = unnamed
    rows = []
    for voice in whole:
        faults: tuple[Fault, ...] = ()
        position, velocity = voice.position, voice.velocity
        if voice.names:
            position, velocity = voice.layout(names).row(position, velocity)
        else:
            faults = (
                Fault.of(
                    NOTE,
                    JOINTS,
                    voice.stamp_ns,
                    "no names were recorded: they are taken to be in the arm's order",
                    True,
                ),
            )
            if velocity.shape != position.shape:
                velocity = np.full_like(position, np.nan)
        rows.append(JointStream(voice.stamp_ns, position, velocity, names, voice.log_ns, faults))
    return _unanimous(whole, rows, where) if rows else _numbered(_joined(voices, names))


def _joined(voices: list[_Voice], names: tuple[str, ...]) -> JointStream:
    """Rows from messages each of which has a part of the joints: at the instants of those that
    came most often, the other joints on straight lines between the messages around.
    """
    parts = [voice for voice in voices if voice.position.shape[1] == len(voice.names)]
    saying = {name: [one for one in parts if one.names.count(name) == 1] for name in names}
    if not names or not all(saying.values()):
        return _no_rows(names)
    base = max((voice for its in saying.values() for voice in its), key=len)
    position, velocity = np.full((2, len(base), joint_count()), np.nan)
    for k, name in enumerate(names):
        voice = base if base in saying[name] else max(saying[name], key=len)
        column = voice.names.index(name)
        position[:, k] = _between(base.stamp_ns, voice.stamp_ns, voice.position[:, column])
        if voice.n_velocities == len(voice.names):
            velocity[:, k] = _between(base.stamp_ns, voice.stamp_ns, voice.velocity[:, column])
    rows = JointStream(base.stamp_ns, position, velocity, names, base.log_ns)
    others = ", ".join(name for name in names if name not in base.names)
    text = (
        f"{others} come in {_APART}: taken at the instants of the others, on straight lines"
        " between two of them"
    )
    return replace(rows, faults=(_note(rows, text),))


def _between(at: np.ndarray, stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at instants (n,) on straight lines between samples (m,); nan where these are too far
    apart.
    """
    order = np.argsort(stamps, kind="stable")
    stamps, values = stamps[order], values[order]
    found = np.interp(at - stamps[0], stamps - stamps[0], values, np.nan, np.nan)
    after = np.minimum(np.searchsorted(stamps, at), len(stamps) - 1)
    pause = stamps[after] - stamps[np.maximum(after - 1, 0)]
    return np.where((stamps[after] == at) | (pause < AT_ONCE_NS), found, np.nan)


def _merged(parts: Sequence[JointStream]) -> JointStream:
    """Rows of several, in the order of recording."""
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS}
    faults = tuple(fault for part in parts for fault in part.faults)
    merged = JointStream(**columns, names=parts[0].names, faults=faults)
    return merged.take(np.argsort(merged.log_ns, kind="stable"))


def _unanimous(voices: list[_Voice], rows: list[JointStream], where: SignalSource) -> JointStream:
    """All rows, without those of a publisher that says the same all the time while the others
    move.

    ValueError where two contradict each other, and nothing tells which of them is the arm's.
    """
    merged, faults = _numbered(_merged(rows)), []
    kept = list(range(len(rows)))
    while len(back := _leaps_back(merged)) >= OFTEN:
        # the same to the last bit
        still = [k for k in kept if not np.nan_to_num(np.ptp(rows[k].position, axis=0)).any()]
        if still and len(still) < len(kept):
            faults += [_silenced(rows[k], str(voices[k])) for k in still]
            kept = [k for k in kept if k not in still]
            merged = _numbered(_merged([rows[k] for k in kept]))
            continue
        if len(kept) > 1:
            one, other = sorted(sorted(kept, key=lambda k: -len(rows[k]))[:2])
            raise ValueError(
                _contradiction(voices[one], voices[other], rows[one], rows[other], where)
            )
        merged, found = _without_constant(merged, back, where)
        faults.append(found)
    return replace(merged, faults=(*merged.faults, *faults))


def _turns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Largest difference of joints (n,) between positions (n, 7); whole turns are none."""
    return np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=1)


def _without_constant(
    states: JointStream, back: np.ndarray, where: SignalSource
) -> tuple[JointStream, Fault]:
    """Without the rows of a second publisher that says the same all the time, in messages that
    look like those of the first.

    back: rows that leap away and back (k,). ValueError if a second one moves, too.
    """
    values, count = np.unique(states.position[back] + 0.0, axis=0, return_counts=True)
    same = (states.position == values[np.argmax(count)]).all(axis=1)
    if count.max() >= OFTEN and len(_leaps_back(states.take(~same))) < OFTEN:
        return states.take(~same), _silenced(states.take(same), f"{int(same.sum())} messages")
    k = back[len(back) // 2]
    raise ValueError(
        f"{where.topic}: two publishers give different positions of the same joints,"
        f" {np.round(states.position[k - 1], 3).tolist()} and"
        f" {np.round(states.position[k], 3).tolist()} at {1e-9 * states.stamp_ns[k]:.3f} s, in"
        " messages that nothing tells apart: record them on topics of their own"
    )


def _leaps_back(states: JointStream) -> np.ndarray:
    """Rows that are away from those before, whereas one of the next rows is near these again (k,)."""
    q, log = states.position, states.log_ns
    if len(q) < 3:
        return np.empty(0, int)
    leap = _turns(q[1:-1], q[:-2])
    apart = APART * max(1.0, float(np.ptp(q, axis=0).max()))
    if np.sum(leap > apart) < OFTEN:
        return np.empty(0, int)
    back = np.full(len(leap), np.inf)
    for ahead in range(2, min(6, len(q))):
        later = np.minimum(np.arange(len(leap)) + ahead, len(q) - 1)
        soon = log[later] - log[:-2] < AT_ONCE_NS
        back = np.minimum(back, np.where(soon, _turns(q[later], q[:-2]), np.inf))
    return np.flatnonzero((leap > apart) & (back < 0.25 * leap)) + 1


def _silenced(rows: JointStream, voice: str) -> Fault:
    value = np.round(rows.position[0], 3).tolist()
    said = "zeros" if not rows.position[0].any() else f"always {value}"
    return Fault.of(
        "other_publisher",
        JOINTS,
        rows.stamp_ns,
        f"{voice} say {said} while the others move: another publisher's, left out",
        True,
    )


def _contradiction(
    one: _Voice, other: _Voice, rows: JointStream, others: JointStream, where: SignalSource
) -> str:
    middle = len(others) // 2
    near = int(np.argmin(np.abs(rows.log_ns - others.log_ns[middle])))
    said = (part[k] for part, k in ((rows.position, near), (others.position, middle)))
    text = (
        f"{where.topic}: two publishers contradict each other of the arm's joints: {one}, and"
        f" {other}; {' against '.join(str(np.round(q, 3).tolist()) for q in said)}"
    )
    keys = [f"listed: [{', '.join(voice.names)}]" for voice in (one, other)]
    if one.names == other.names:
        keys = [f"frame: {voice.frame or '(none)'}" for voice in (one, other)]
    if keys[0] == keys[1]:
        return f"{text}: record them on topics of their own"
    lines = " or ".join(f"joints: {{topic: {where.topic}, {key}}}" for key in keys)
    return f"{text}: say which is meant in a mapping, {lines}"


def _why_none(voices: list[_Voice], names: tuple[str, ...], where: SignalSource) -> str:
    """Why no message has the arm's joints."""
    told = {name for voice in voices for name in voice.names}
    if missing := [name for name in names if name not in told]:
        return (
            f"{where.topic}: no joint '{missing[0]}', only {sorted(told)}: name the arm's joints"
            " in a mapping"
        )
    reasons = Counter({voice.layout(names).why: len(voice) for voice in voices})
    return f"{where.topic}: no message has the arm's joints: " + "; ".join(
        f"{n} times: {why}" for why, n in reasons.most_common(3) if why
    )


def _numbered(states: JointStream) -> JointStream:
    """Without rows that lack a position."""
    known = np.isfinite(states.position).all(axis=1)
    if known.all():
        return states
    never = np.flatnonzero(~np.isfinite(states.position).any(axis=0))
    if len(never) or not known.any():
        names = states.names or joint_names()
        which = f"joint {names[never[0]]} never has" if len(never) else "no state has"
        raise ValueError(
            f"{which} a position that is a number, in {len(states)} joint states: look at the"
            " driver"
        )
    gone = states.stamp_ns[~known]
    fault = Fault.of(
        "not_finite",
        JOINTS,
        gone,
        (
            f"{len(gone)} states lack the position of a joint (not a number, or nobody said it):"
            " left out"
        ),
        True,
    )
    return replace(states.take(known), faults=(*states.faults, fault))


# what else was on the topic


def _of_others(
    voices: list[_Voice], namings: list[tuple[str, ...]], states: JointStream
) -> list[Fault]:
    """A note for all joints that are not the arm's, and one for all messages that are no use.

    namings: that were taken.
    """
    if not (names := namings[0]):
        return []
    notes, used = [], set().union(*namings)
    foreign: Counter[str] = Counter()
    useless: Counter[str] = Counter()
    for voice in voices:
        foreign.update({name: len(voice) for name in voice.names if name not in used})
        layouts = [voice.layout(one) for one in namings if one]
        is_taken = any(one.order is not None for one in layouts)
        if voice.names and not is_taken and not layouts[0].is_of_others:
            useless[layouts[0].why.partition(": ")[0]] += len(voice)
        if not voice.names and len(voices) > 1:
            useless["has no names"] += len(voice)
    if foreign:
        text = f"besides the arm's there are {_listed(list(foreign))}: not looked at"
        notes.append(_note(states, text, max(foreign.values())))
    if not any(_APART in fault.message for fault in states.faults):
        notes += [_note(states, f"{n} messages left out: {why}", n) for why, n in useless.items()]
    if names != joint_names():
        text = f"the joints of the arm are taken to be {_listed(names)}, in this order"
        notes.append(_note(states, text))
    return notes


def _note(states: JointStream, text: str, count: int | None = None) -> Fault:
    return Fault.of(NOTE, JOINTS, states.stamp_ns, text, True, count=count)


# velocities


def _with_speeds(
    stamps: np.ndarray, position: np.ndarray, velocity: np.ndarray
) -> tuple[np.ndarray, list[Fault]]:
    """Velocities (n, 7), those that were not recorded by differences of positions, and what was
    not.
    """
    if not velocity.size:
        return velocity, []
    moves = np.nanmax(position, axis=0) - np.nanmin(position, axis=0) > MOVES
    known = np.isfinite(velocity)
    zero = moves & (np.nan_to_num(velocity) == 0.0).all(axis=0) & known.any(axis=0)
    missing = ~known | zero
    if not missing.any() or len(stamps) < 2:
        return velocity, []
    count = int(missing.any(axis=1).sum())
    text = f"{count} states lack velocities" if known.any() else "velocities were not recorded"
    if zero.any():
        text = f"velocities are zero for {int(zero.sum())} joints that move: taken as missing"
    text += "; from the positions instead"
    fault = Fault.of(NOTE, JOINTS, stamps, text, True, count=count)
    return np.where(missing, _speeds(stamps, position), velocity), [fault]


def _speeds(stamps: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Velocities (n, 7) by differences of positions, not over silences nor whole turns."""
    speeds = np.zeros_like(position)
    order = np.argsort(stamps, kind="stable")
    order = order[np.diff(stamps[order], prepend=stamps[order[0]] - 1) > 0]
    for rows in np.split(order, np.flatnonzero(np.diff(stamps[order]) > STRETCH_NS) + 1):
        if len(rows) > 1:
            time = 1e-9 * (stamps[rows] - stamps[rows[0]])
            speeds[rows] = np.gradient(np.unwrap(position[rows], axis=0), time, axis=0)
    return speeds
