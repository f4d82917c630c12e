"""The arm's joint states out of all that was published on their topic: by gripper, other arm and
twin as well as by the arm.

Each message is read by its own names (`joint_layout`). Messages that are laid out alike are one
voice. Those that name the arm's joints are taken; where two voices contradict each other, it must
be clear which one is the arm's, or a mapping says it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dart_skill.common.constants import N_JOINTS
from dart_skill.common.world import joint_names
from dart_skill.recording.bags import BagMessage, columns_by_layout
from dart_skill.recording.imports.faults import NOTE, Fault
from dart_skill.recording.imports.mapping import ANGLE_UNITS, SignalSource
from dart_skill.recording.joint_state import JointLayout, joint_layout

JOINTS = "joints"
"""What the arm's joints are called in faults and in a mapping."""
APART = 0.02
"""Positions that are farther apart are not the same: of an arm that moves less than a radian
[rad], else of its range.
"""
AT_ONCE_NS = 250_000_000
"""Messages that are nearer to each other in time can be compared [ns]."""
SILENCE_NS = 1_000_000_000
"""A voice that is silent for longer may have been replaced by another one [ns]."""
OFTEN = 10
"""Fewest leaps away and back that tell of a second publisher."""
STRETCH_NS = 500_000_000
"""Speeds are not taken over a longer silence [ns]."""
MOVES = 0.01
"""A joint whose positions differ by more has moved [rad]."""


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
        (n, 7) [rad/s].
    names
        Of the joints; may be empty.
    """

    stamp_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class States:
    """Rows of the arm's joints, in the order of recording, as they were recorded.

    Parameters
    ----------
    stamp_ns, log_ns
        (n,) [ns].
    position, velocity
        (n, 7) [rad], [rad/s], in the senses and from the zeros that were recorded; nan where they
        were not recorded.
    names
        Of the joints; may be empty.
    faults
        What else was on the topic, and what is wrong.
    """

    stamp_ns: np.ndarray
    log_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    names: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()

    @classmethod
    def none(cls, names: tuple[str, ...]) -> States:
        """No rows."""
        stamps, rows = np.empty(0, np.int64), np.empty((0, N_JOINTS))
        return cls(stamps, stamps, rows, rows, names)

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def take(self, index: np.ndarray) -> States:
        """The rows of an index array or mask."""
        columns = {
            name: getattr(self, name)[index]
            for name in ("stamp_ns", "log_ns", "position", "velocity")
        }
        return replace(self, **columns)


@dataclass(frozen=True, eq=False)
class _Voice:
    """Messages of one topic that are laid out alike.

    * names: of all joints that they name; n_velocities: how many of those they have; frame: of
      their header.
    * index: places among all messages (n,), ascending; stamp_ns, log_ns: (n,).
    * position, velocity: (n, k).
    """

    names: tuple[str, ...]
    n_velocities: int
    frame: str
    index: np.ndarray
    stamp_ns: np.ndarray
    log_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray

    def layout(self, wanted: tuple[str, ...]) -> JointLayout:
        return joint_layout(self.names, self.position.shape[1], self.n_velocities, wanted)

    def __len__(self) -> int:
        return len(self.index)

    def __str__(self) -> str:
        names = f"{_listed(self.names)}" if self.names else "no joint by name"
        speeds = "" if self.n_velocities else ", no velocities"
        return (
            f"{len(self)} messages that list"
            f" {names}{speeds}{f', in frame {self.frame!r}' if self.frame else ''}"
        )


def read_states(
    messages: Sequence[BagMessage],
    types: Any,
    decode: Callable[[BagMessage], Any],
    where: SignalSource,
    stamp_of: Callable[[Any], int],
) -> States:
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
        return States.none(where.names)
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
    states: States, stamps: np.ndarray, where: SignalSource
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
    scale = np.array(where.signs) if where.signs else np.ones(N_JOINTS)
    position = scale * states.position + (np.array(where.zeros) if where.zeros else 0.0)
    velocity = scale * states.velocity
    velocity, faults = _with_speeds(stamps, position, velocity)
    return JointStream(stamps, position, velocity, states.names), faults


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
        numbers = (
            np.array(one.position, dtype=float)[None],
            np.array(one.velocity, dtype=float)[None],
        )
        parts.setdefault(_key(one), []).append(([k], [stamp_of(one)], *numbers))
    voices = []
    for (names, frame, _, n_velocities), several in parts.items():
        index, stamps, position, velocity = (
            np.concatenate([np.asarray(part) for part in column])
            for column in zip(*several, strict=True)
        )
        order = np.argsort(index)
        index = index[order].astype(int)
        voices.append(
            _Voice(
                names,
                n_velocities,
                frame,
                index,
                stamps[order].astype(np.int64),
                log_ns[index],
                scale * position[order],
                scale * velocity[order],
            )
        )
    return sorted(voices, key=lambda voice: int(voice.index[0]))


def _key(message: Any) -> tuple:
    return (
        tuple(message.name),
        message.header.frame_id,
        len(message.position),
        len(message.velocity),
    )


# which joints are meant


def _namings(voices: list[_Voice], topic: str) -> list[tuple[str, ...]]:
    """What the arm's joints are called, by falling right: those of config/wam.yaml; these with
    something before or behind; the only seven.

    ValueError where several names would do as well.
    """
    ours, told = joint_names(), {name for voice in voices for name in voice.names}
    variants = [
        tuple(f"{before}{name}{behind}" for name in ours)
        for before, behind in _additions(told, ours[0])
    ]
    variants = [one for one in variants if set(one) <= told]
    if set(ours) <= told:
        return [ours, *(one for one in variants if one != ours)]
    if variants:
        return _unless_at_once(variants, voices, topic)
    sevens = {
        frozenset(voice.names): voice.names
        for voice in reversed(voices)
        if len(set(voice.names)) == N_JOINTS
    }
    if sevens:
        return _unless_at_once(list(sevens.values())[::-1], voices, topic)
    if any(not voice.names and voice.position.shape[1] == N_JOINTS for voice in voices):
        return [()]
    if set(ours) & told:
        return [ours]
    raise ValueError(
        f"{topic}: {_seen(voices)}: name the arm's joints in a mapping, joints: {{topic: {topic},"
        " names: [...]}"
    )


def _additions(told: set[str], first: str) -> list[tuple[str, str]]:
    """What stands before and behind the name of the first joint wherever it is a part of another
    name.
    """
    return sorted(
        (name[: name.index(first)], name[name.index(first) + len(first) :])
        for name in told
        if first in name
    )


def _unless_at_once(
    namings: list[tuple[str, ...]], voices: list[_Voice], topic: str
) -> list[tuple[str, ...]]:
    """Names, of which several must not have been used at the same time."""
    times = [_log_of(voices, names) for names in namings]
    for k, one in enumerate(times):
        for j in range(k):
            if _are_at_once(one, times[j]):
                lines = " or ".join(
                    f"joints: {{topic: {topic}, names: [{', '.join(namings[i])}]}}" for i in (j, k)
                )
                raise ValueError(
                    f"{topic}: {_seen(voices)}: which of them is the arm? Say it in a mapping,"
                    f" {lines}"
                )
    return namings


def _log_of(voices: list[_Voice], names: tuple[str, ...]) -> np.ndarray:
    times = [voice.log_ns for voice in voices if set(names) <= set(voice.names)]
    return np.sort(np.concatenate(times)) if times else np.empty(0, np.int64)


def _are_at_once(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether one publisher spoke while another did: log times (n,), (m,), ascending, of both
    [ns].
    """
    if not (len(one) and len(other)):
        return False
    after = np.searchsorted(one, other)
    inside = (after > 0) & (after < len(one))
    between = (
        one[np.clip(after, 1, len(one) - 1)] - one[np.clip(after, 1, len(one) - 1) - 1]
        if len(one) > 1
        else np.zeros(len(other))
    )
    return bool(np.any(inside & (between < SILENCE_NS)))


def _seen(voices: Sequence[_Voice]) -> str:
    return "; ".join(map(str, voices[:6])) + (
        f"; {len(voices) - 6} other kinds" if len(voices) > 6 else ""
    )


def _listed(names: Sequence[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (
        f" and {len(names) - most} more" if len(names) > most else ""
    )


# the rows


def _rows(
    voices: list[_Voice], namings: list[tuple[str, ...]], where: SignalSource
) -> tuple[States, list[tuple[str, ...]]]:
    """Rows of the joints that are called so, and what they are called; those of a later naming
    only where the earlier ones are silent.
    """
    parts: list[States] = []
    taken = []
    for names in namings:
        rows = _rows_of(voices, names, where)
        before = (
            np.sort(np.concatenate([part.log_ns for part in parts]))
            if parts
            else np.empty(0, np.int64)
        )
        if (
            len(rows)
            and not _are_at_once(before, rows.log_ns)
            and not _are_at_once(rows.log_ns, before)
        ):
            if parts:
                rows = replace(
                    rows,
                    faults=(
                        *rows.faults,
                        _note(rows, f"from here on they are called {_listed(names)}"),
                    ),
                )
            parts.append(rows)
            taken.append(names)
    if not parts:
        raise ValueError(_why_none(voices, namings, where))
    return _merged(parts), taken


def _rows_of(voices: list[_Voice], names: tuple[str, ...], where: SignalSource) -> States:
    """Rows of the arm's joints under some names; without a name those of messages that name
    nothing.
    """
    whole = [
        voice
        for voice in voices
        if (not names and not voice.names) or voice.layout(names).order is not None
    ]
    if not names or not whole:
        unnamed = [
            voice for voice in voices if not voice.names and voice.position.shape[1] == N_JOINTS
        ]
        whole = whole or (
            unnamed if not any(set(names) & set(voice.names) for voice in voices) else []
        )
    return (
        _unanimous(whole, [_row_states(voice, names) for voice in whole], where)
        if whole
        else _numbered(_joined(voices, names))
    )


def _row_states(voice: _Voice, names: tuple[str, ...]) -> States:
    if not voice.names:
        velocity = (
            voice.velocity
            if voice.velocity.shape == voice.position.shape
            else np.full_like(voice.position, np.nan)
        )
        states = States(voice.stamp_ns, voice.log_ns, voice.position, velocity, names)
        return replace(
            states,
            faults=(
                _note(
                    states,
                    "no names were recorded: they are taken to be in the arm's order",
                ),
            ),
        )
    position, velocity = voice.layout(names).row(voice.position, voice.velocity)
    return States(voice.stamp_ns, voice.log_ns, position, velocity, names)


def _merged(parts: Sequence[States]) -> States:
    """Rows of several, in the order of recording."""
    stamps, log_ns, position, velocity = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("stamp_ns", "log_ns", "position", "velocity")
    )
    faults = tuple(fault for part in parts for fault in part.faults)
    return States(stamps, log_ns, position, velocity, parts[0].names, faults).take(
        np.argsort(log_ns, kind="stable")
    )


def _unanimous(voices: list[_Voice], rows: list[States], where: SignalSource) -> States:
    """All rows, without those of a publisher that says the same all the time while the others
    move.

    ValueError where two contradict each other, and nothing tells which of them is the arm's.
    """
    merged, faults = _numbered(_merged(rows)), []
    kept = list(range(len(rows)))
    while len(back := _leaps_back(merged)) >= OFTEN:
        still = [k for k in kept if _is_still(rows[k].position)]
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


def _is_still(position: np.ndarray) -> bool:
    """Whether positions (n, 7) are the same to the last bit."""
    return not np.nan_to_num(np.ptp(position, axis=0)).any()


def _apart(position: np.ndarray) -> float:
    """What makes two positions different, in their unit."""
    return APART * max(
        1.0,
        float(np.nanmax(np.nanmax(position, axis=0) - np.nanmin(position, axis=0), initial=0.0)),
    )


def _turns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Largest difference of joints (n,) between positions (n, 7); whole turns are none."""
    return np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=1)


def _without_constant(
    states: States, back: np.ndarray, where: SignalSource
) -> tuple[States, Fault]:
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


def _leaps_back(states: States) -> np.ndarray:
    """Rows that are away from those before, whereas one of the next rows is near these again (k,)."""
    q, log = states.position, states.log_ns
    if len(q) < 3:
        return np.empty(0, int)
    leap, apart = _turns(q[1:-1], q[:-2]), _apart(q)
    if np.sum(leap > apart) < OFTEN:
        return np.empty(0, int)
    back = np.full(len(leap), np.inf)
    for ahead in range(2, min(6, len(q))):
        later = np.minimum(np.arange(len(leap)) + ahead, len(q) - 1)
        back = np.minimum(
            back, np.where(log[later] - log[:-2] < AT_ONCE_NS, _turns(q[later], q[:-2]), np.inf)
        )
    return np.flatnonzero((leap > apart) & (back < 0.25 * leap)) + 1


def _silenced(rows: States, voice: str) -> Fault:
    value = np.round(rows.position[0], 3).tolist()
    said = "zeros" if not rows.position[0].any() else f"always {value}"
    text = f"{voice} say {said} while the others move: another publisher's, left out"
    return Fault.of("other_publisher", JOINTS, rows.stamp_ns, text, True)


def _contradiction(
    one: _Voice, other: _Voice, rows: States, others: States, where: SignalSource
) -> str:
    near = int(np.argmin(np.abs(rows.log_ns - others.log_ns[len(others) // 2])))
    said = [
        np.round(part.position[k], 3).tolist()
        for part, k in ((rows, near), (others, len(others) // 2))
    ]
    text = (
        f"{where.topic}: two publishers contradict each other of the arm's joints: {one}, and"
        f" {other}; {said[0]} against {said[1]}"
    )
    if one.names != other.names:
        lines = " or ".join(
            f"joints: {{topic: {where.topic}, listed: [{', '.join(voice.names)}]}}"
            for voice in (one, other)
        )
    elif one.frame != other.frame:
        lines = " or ".join(
            f"joints: {{topic: {where.topic}, frame: {voice.frame or '(none)'}}}"
            for voice in (one, other)
        )
    else:
        return f"{text}: record them on topics of their own"
    return f"{text}: say which is meant in a mapping, {lines}"


def _joined(voices: list[_Voice], names: tuple[str, ...]) -> States:
    """Rows from messages each of which has a part of the joints: at the instants of those that
    came most often, the other joints on straight lines between the messages around.
    """
    parts = []
    for voice in voices:
        joints = (
            [k for k, name in enumerate(names) if voice.names.count(name) == 1]
            if voice.position.shape[1] == len(voice.names)
            else []
        )
        if joints:
            parts.append((joints, voice, [voice.names.index(names[k]) for k in joints]))
    covered = {k for joints, _, _ in parts for k in joints}
    if len(covered) < N_JOINTS:
        return States.none(names)
    base = max(parts, key=lambda part: len(part[1]))[1]
    position, velocity = np.full((2, len(base), N_JOINTS), np.nan)
    for k in range(N_JOINTS):
        saying = max(
            (part for part in parts if k in part[0]),
            key=lambda part: (part[1] is base, len(part[1])),
        )
        voice, place = saying[1], saying[2][saying[0].index(k)]
        position[:, k] = _between(base.stamp_ns, voice.stamp_ns, voice.position[:, place])
        if voice.n_velocities == len(voice.names):
            velocity[:, k] = _between(base.stamp_ns, voice.stamp_ns, voice.velocity[:, place])
    states = States(base.stamp_ns, base.log_ns, position, velocity, names)
    others = [names[k] for k in range(N_JOINTS) if names[k] not in base.names]
    text = (
        f"{', '.join(others)} come in messages of their own: taken at the instants of the others,"
        " on straight lines between two of them"
    )
    return replace(states, faults=(_note(states, text),))


def _between(at: np.ndarray, stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at instants (n,) on straight lines between samples (m,); nan where these are too far
    apart.
    """
    order = np.argsort(stamps, kind="stable")
    stamps, values = stamps[order], values[order]
    origin = int(stamps[0])
    found = np.interp((at - origin).astype(float), (stamps - origin).astype(float), values)
    after = np.clip(np.searchsorted(stamps, at), 0, len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    near = (stamps[after] == at) | (
        (at > stamps[before])
        & (at < stamps[after])
        & (stamps[after] - stamps[before] < AT_ONCE_NS)
    )
    return np.where(near, found, np.nan)


def _why_none(voices: list[_Voice], namings: list[tuple[str, ...]], where: SignalSource) -> str:
    """Why no message has the arm's joints."""
    names = namings[0] or joint_names()
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


def _numbered(states: States) -> States:
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
    text = (
        f"{len(gone)} states lack the position of a joint (not a number, or nobody said it):"
        " left out"
    )
    fault = Fault.of("not_finite", JOINTS, gone, text, True)
    return replace(states.take(known), faults=(*states.faults, fault))


# what else was on the topic


def _of_others(
    voices: list[_Voice], namings: list[tuple[str, ...]], states: States
) -> list[Fault]:
    """A note for all joints that are not the arm's, and one for all messages that are no use.
    namings: that were taken.
    """
    used = {name for names in namings for name in names}
    notes = []
    foreign: Counter[str] = Counter()
    useless: Counter[str] = Counter()
    for voice in voices:
        layouts = [voice.layout(names) for names in namings if names]
        layout = (
            None if not layouts or any(one.order is not None for one in layouts) else layouts[0]
        )
        for name in dict.fromkeys(voice.names):
            if name not in used:
                foreign[name] += len(voice)
        if layout is not None and not layout.is_of_others and voice.names:
            useless[layout.why.partition(": ")[0]] += len(voice)
        if not voice.names and namings[0] and len(voices) > 1:
            useless["has no names"] += len(voice)
    if foreign and namings[0]:
        text = f"besides the arm's there are {_listed(list(foreign))}: not looked at"
        notes.append(_note(states, text, max(foreign.values())))
    if not any("messages of their own" in fault.message for fault in states.faults):
        notes += [_note(states, f"{n} messages left out: {why}", n) for why, n in useless.items()]
    if namings[0] and namings[0] != joint_names():
        notes.append(
            _note(
                states,
                f"the joints of the arm are taken to be {_listed(namings[0])}, in this order",
            )
        )
    return notes


def _note(states: States, text: str, count: int | None = None) -> Fault:
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
    zero = (
        moves
        & (np.nan_to_num(velocity, nan=0.0) == 0.0).all(axis=0)
        & np.isfinite(velocity).any(axis=0)
    )
    missing = ~np.isfinite(velocity) | zero
    if not missing.any() or len(stamps) < 2:
        return velocity, []
    text = (
        "velocities were not recorded"
        if np.isnan(velocity).all()
        else f"{int(missing.any(axis=1).sum())} states lack velocities"
    )
    if zero.any():
        text = f"velocities are zero for {int(zero.sum())} joints that move: taken as missing"
    count = int(missing.any(axis=1).sum())
    text += "; from the positions instead"
    fault = Fault.of(NOTE, JOINTS, stamps, text, True, count=count)
    return np.where(missing, _speeds(stamps, position), velocity), [fault]


def _speeds(stamps: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Velocities (n, 7) by differences of positions, not over silences nor whole turns."""
    speeds = np.zeros_like(position)
    order = np.argsort(stamps, kind="stable")
    order = order[np.diff(stamps[order], prepend=stamps[order[0]] - 1) > 0]
    ends = np.concatenate(
        [[0], np.flatnonzero(np.diff(stamps[order]) > STRETCH_NS) + 1, [len(order)]]
    )
    for first, last in zip(ends[:-1], ends[1:], strict=True):
        rows = order[first:last]
        if len(rows) > 1:
            time = 1e-9 * (stamps[rows] - stamps[rows[0]])
            speeds[rows] = np.gradient(np.unwrap(position[rows], axis=0), time, axis=0)
    return speeds
