"""Why the joints and the cameras of a recording disagree about the hand: each cause is tried, and
the best explanation says what mends it.

The recording is read with its numbers as they stand. What the mapping says of them is tried first.
Then the causes are looked for: clocks that differ, another body, the convention of the joints,
unit and axes of positions, and how orientations are told.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dart_skill.arm import ArmModel, Sightings, fit_positions, measure_registration, turn_angles
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.quaternions import matrices, of_matrices
from dart_skill.recording import BagReader
from dart_skill.recording.imports import (
    AS_OURS,
    BODY_TYPES,
    LENGTH_UNITS,
    OWN,
    UP_AXES,
    Axes,
    Clock,
    JointStream,
    PoseSource,
    PoseStream,
    RecordingMapping,
    ThrowRecording,
    axes_matrix,
    filled_topics,
    flow_text,
    mended_joints,
    mended_pose,
    nearest_axes,
    read_recording,
    without_running_back,
)
from dart_skill.session._alignment import (
    LOOKED_AT,
    ClockOffset,
    Instants,
    at_instants,
    clock_offset,
    diverse_instants,
    evenly_spaced,
    joints_at,
)
from dart_skill.session._clock_steps import (
    Change,
    changes,
    changes_of_movements,
    rows_of_change,
    steps_of,
)
from dart_skill.session._joint_conventions import (
    APART,
    STARTS,
    ConventionSearch,
    Explanation,
    JointConvention,
)

AGREED_POSITION = 0.015
"""Root mean square of positions up to which joints and cameras agree [m]."""
AGREED_ANGLE = 0.08
"""Root mean square of orientations up to which they agree [rad]."""
LATE = 0.02
"""Smallest offset of clocks that matters [s]."""
REACH = 0.3
"""Farthest offset from the one by movements that is looked for [s]."""
FINE = 0.002
"""Step in which it is looked for [s]."""
CLOCK_ROUNDS = 4
"""Largest number of rounds in which clocks and hand are found in turn."""
FARTHEST = 5.0
"""Distance beyond which the hand is elsewhere, in parts of AGREED_POSITION."""
CHANGE = 2.0
"""What a change of the offset costs, in instants at which the hand is elsewhere."""
PIECES = 5
"""Number of parts of a recording whose offsets are compared."""
STEADY = 0.012
"""Largest difference between offsets of parts that may be chance [s]."""
UNIT_ERROR = 0.05
"""Share by which a length may differ from one of LENGTH_UNITS and still be told in it."""
UNIT_NAMES = {
    "m": "metres",
    "cm": "centimetres",
    "mm": "millimetres",
    "in": "inches",
    "ft": "feet",
}
"""Units of length in words."""
TURNED = 0.1
"""Smallest turn of a world or of a body that a mapping must say [rad]."""
MOVED = 0.1
"""Smallest shift of a world or of a body that a mapping must say [m]."""
LEAP = 0.5
"""Angle from which an orientation has leapt to another solution [rad]."""
FEWEST_LEAPS = 0.02
"""Share of orientations from which such leaps are a cause."""
UNCLEAR_STEPS = (
    "the clocks of joints and cameras jump against each other, and it is not clear when: record"
    " both with one clock, or cut the recording"
)
"""What is said of clocks that were set, where no steps explain it."""
SAME_MOVEMENTS = 0.7
"""Smallest correlation of two recordings of the same movements."""
AWAY = 0.3
"""Distance at which a ball has left the hand [m]."""
LIKELY = 0.6
"""Share of a misfit of commands and releases that another clock must leave at most."""
SOON = 0.6
"""Longest time from the command to open the hand until the ball is so far away [s]."""


@dataclass(frozen=True)
class Cause:
    """A cause for which joints and cameras disagree.

    Parameters
    ----------
    text
        What it is, in words.
    line
        Of a mapping, which mends it; empty where none does.
    """

    text: str
    line: str = ""

    def __str__(self) -> str:
        return self.text + (f" [mapping: {self.line}]" if self.line else "")


@dataclass(frozen=True)
class Disagreement:
    """Why joints and cameras disagree about the hand.

    Parameters
    ----------
    before
        Position [m] and orientation [rad] by which they disagree as the recording is read, root
        mean squares; inf where their stamps have no time in common.
    after
        The same with all causes mended.
    causes
        What explains it; none where nothing does.
    mapping
        With which the recording reads right, as far as one can mend it; None where nothing
        explains it.
    """

    before: tuple[float, float]
    after: tuple[float, float]
    causes: tuple[Cause, ...]
    mapping: RecordingMapping | None

    @property
    def explained(self) -> float:
        """Share of the mean square of the disagreement that the causes explain, from 0 to 1."""
        was, left = (
            float(np.hypot(p / AGREED_POSITION, a / AGREED_ANGLE))
            for p, a in (self.before, self.after)
        )
        return max(0.0, 1.0 - (left / was) ** 2) if self.mapping is not None else 0.0

    @property
    def can_be_mended(self) -> bool:
        """Whether a mapping mends all of it."""
        return self.mapping is not None and _is_small(*self.after)

    def __str__(self) -> str:
        """In words."""
        causes = "; ".join(map(str, self.causes))
        if _is_small(*self.before):
            return (
                "joints and cameras saw the same movements, but not in our axes, or not at the"
                f" same times: {causes}"
            )
        head = f"joints and cameras disagree about the hand by {_far(self.before)}"
        if not any(one.line for one in self.causes):
            return f"{head}: {causes}"
        return (
            f"{head}: {causes}. This explains {100 * self.explained:.1f} % of it and leaves"
            f" {_far(self.after)}"
        )


def disagreement(
    path: str | os.PathLike, mapping: RecordingMapping | None = None
) -> Disagreement | None:
    """Why joints and cameras of a recording disagree; None where they agree, or where one of them
    was not recorded.

    Parameters
    ----------
    path
        Of the recording.
    mapping
        By which it is read; None: a bag of ours.
    """
    told = mapping or OWN
    as_it_stands = read_recording(path, _as_it_stands(told), mend=False)
    if (
        as_it_stands.joints is None
        or len(as_it_stands.joints.stamp_ns) < 2
        or len(as_it_stands.bodies["hand"]) < 2
    ):
        return None
    before, agrees = _errors(path, told, mend=False)
    search = _Search(path, told, as_it_stands)
    if agrees and not search.is_set:
        return None
    found = search.found(before)
    if found.can_be_mended or not search.is_set:
        return found
    again = _Search(path, told, as_it_stands, may_be_set=False)
    steady = again.found(before)  # a clock that drifts may look like one that was set
    if steady.can_be_mended:
        return steady
    return (
        Disagreement(before, before, (Cause(UNCLEAR_STEPS),), None)
        if again.is_set or found.mapping is not None
        else found
    )


def _is_small(position: float, angle: float = 0.0) -> bool:
    """Whether joints and cameras agree about the hand that differ by this much [m], [rad]."""
    return position < AGREED_POSITION and angle < AGREED_ANGLE


def _far(error: tuple[float, float]) -> str:
    if not np.isfinite(error[0]):
        return "all that they tell, as their stamps have no time in common"
    length = f"{100 * error[0]:.1f} cm" if error[0] < 10.0 else f"{error[0]:.0f} m"
    return f"{length} and {np.degrees(error[1]):.1f} degrees"


def _as_it_stands(told: RecordingMapping) -> RecordingMapping:
    """The mapping that reads the same topics and columns, with their numbers as they stand."""

    def plain(clock: Clock) -> Clock:
        return replace(clock, shift_ns=0, drift=0.0, steps=())

    def body(where: PoseSource) -> PoseSource:
        kept = ("topic", "child", "table", "capture", "fixed", "frame")
        found = PoseSource(
            **{name: getattr(where, name) for name in kept}, clock=plain(where.clock)
        )
        # of a file of motion capture the mapping must say what that does not
        return (
            replace(found, told=where.told | {"xyz"}, length=where.length)
            if where.capture
            else found
        )

    joints = told.joints and replace(
        told.joints, angle="rad", signs=(), zeros=(), clock=plain(told.joints.clock)
    )
    return replace(
        told, bodies={role: body(where) for role, where in told.bodies.items()}, joints=joints
    )


def _errors(
    path: str | os.PathLike, mapping: RecordingMapping, mend: bool
) -> tuple[tuple[float, float], bool]:
    """Position [m] and orientation [rad] by which joints and cameras disagree in a world that may
    stand anywhere, root mean squares; and whether they agree, and stand where the mapping says.
    """
    recording = read_recording(path, mapping, mend=mend)
    assert recording.joints is not None  # as there were some before
    both = [
        diverse_instants(recording.bodies["hand"], recording.joints, 0.0, slow)
        for slow in (True, False)
    ]
    joints, position, quaternion = (
        np.concatenate([getattr(one, name) for one in both])
        for name in ("joints", "position", "quaternion")
    )
    if len(joints) < 3:
        return (np.inf, np.inf), False
    turned = np.isfinite(quaternion).all(axis=1)
    if turned.sum() < 3:
        place, rotation, _ = ArmModel().hand_states(joints, np.zeros_like(joints))
        return (fit_positions(position, place, rotation, may_mirror=False).error, 0.0), False
    joints, position, quaternion = joints[turned], position[turned], quaternion[turned]
    fit = measure_registration(
        Sightings.of_joints(ArmModel(), joints, np.zeros_like(joints), position, quaternion)
    )
    where = fit.registration
    turns = [_turn(matrices(np.array(one))) for one in (where.turn, where.hand_turn)]
    shifts = [np.linalg.norm(one) for one in (where.shift, where.hand_shift)]
    agrees = (
        _is_small(fit.position_error, fit.angle_error)
        and max(turns) < TURNED
        and max(shifts) < MOVED
    )
    return (fit.position_error, fit.angle_error), bool(agrees)


class _Search:
    """The search for the causes of one recording. `found` gives them, and the mapping that mends
    them.
    """

    def __init__(
        self,
        path: str | os.PathLike,
        told: RecordingMapping,
        recording: ThrowRecording,
        may_be_set: bool = True,
    ):
        assert told.joints is not None and recording.joints is not None  # as the caller has looked
        self._path, self._told, self._recording, self._model = path, told, recording, ArmModel()
        self._hand, self._joints, self._where = (
            recording.bodies["hand"],
            recording.joints,
            told.bodies["hand"],
        )
        told_joints, ones = told.joints, (1.0,) * joint_count()
        self._convention = JointConvention(
            told_joints.angle,
            signs=told_joints.signs or ones,
            zeros=told_joints.zeros or tuple(0.0 for _ in ones),
        )
        self._told_offset = 1e-9 * (self._where.clock.shift_ns - told_joints.clock.shift_ns)
        self._was = self._hand.stamp_ns, self._joints.stamp_ns
        clocks = self._where.clock, told_joints.clock
        self._as_told = tuple(
            Clock(steps=clock.steps).corrected(was)
            for clock, was in zip(clocks, self._was, strict=True)
        )
        self._hand = replace(self._hand, stamp_ns=without_running_back(self._as_told[0]))
        self._joints = replace(self._joints, stamp_ns=without_running_back(self._as_told[1]))
        for change in changes_of_movements(self._hand, self._joints) if may_be_set else []:
            self._set(change, least=0.5 * REACH)
        self._aligned = self._joints  # on the clock of the cameras
        self._is_hand: PoseSource | None = None  # another body than the mapping says
        self._causes: list[Cause] = []
        self._mending: defaultdict[str, dict[str, Any]] = defaultdict(dict)

    @property
    def is_set(self) -> bool:
        """Whether a clock was set meanwhile otherwise than the mapping says."""
        now = self._hand.stamp_ns, self._joints.stamp_ns
        return not all(
            np.array_equal(one, other) for one, other in zip(now, self._as_told, strict=True)
        )

    def found(self, before: tuple[float, float]) -> Disagreement:
        """What was found. before: by which joints and cameras disagree as the recording is read."""
        causes, mended = self._run()
        return Disagreement(
            before,
            _errors(self._path, mended, mend=True)[0] if mended else before,
            tuple(causes),
            mended,
        )

    def _run(self) -> tuple[list[Cause], RecordingMapping | None]:
        offset = clock_offset(self._hand, self._joints)
        found, coarse = self._explanation(offset)
        if found.positions.error > AGREED_POSITION:
            return [self._hopeless(offset, found)], None
        found, late, drift, steady = self._with_clocks(found, coarse)
        if self._is_hand is not None:
            name, told = (where.name for where in (self._is_hand, self._where))
            keys = {"hand": {"topic": name}} if self._is_hand.topic else {}
            self._causes.append(
                Cause(
                    f"{name} moves as the hand does, and {told} does not",
                    flow_text(keys) if keys else "",
                )
            )
        self._blame_steps()
        self._blame_clocks(late, drift, steady)
        self._blame_joints(found.convention)
        world = self._blame_positions(found)
        self._blame_orientations(found, world)
        if steady:
            self._blame_leaps(found)
        return self._causes, self._mended()

    def _blame(self, text: str, section: str = "", **keys: Any) -> None:
        line = flow_text({section: keys}) if section else ""
        self._causes.append(Cause(text, line))
        if section:
            self._mending[section] |= keys

    # what explains most

    def _explanation(self, clocks: ClockOffset) -> tuple[Explanation, float]:
        """What explains most, and with which offset of the clocks; another body takes the place of
        the hand where only that explains it.
        """
        tried = []
        for offset in self._offsets(clocks):
            search = self._search(self._hand, offset)
            plain = search.plain(self._convention)
            turned = 0.0 if plain.orientations is None else plain.orientations.error
            agrees = _is_small(plain.positions.error, turned)
            if plain.is_good or (agrees and not plain.is_mirrored):
                return plain, offset
            tried.append((search, plain, offset))
        search, plain, first = tried[0]
        if plain.positions.error > AGREED_POSITION:
            for stream, where in self._other_bodies():
                its = self._offsets(clock_offset(stream, self._joints))[0]
                other = self._search(stream, its).plain(self._convention)
                if other.is_good:
                    self._hand, self._is_hand = stream, where
                    self._was, self._as_told = (
                        (stream.stamp_ns, both[1]) for both in (self._was, self._as_told)
                    )
                    return other, its
        return search.best(self._convention), first

    def _offsets(self, clocks: ClockOffset) -> tuple[float, ...]:
        return clocks.offsets if clocks.is_clear else (self._told_offset,)

    def _search(self, hand: PoseStream, offset: float) -> ConventionSearch:
        seen = diverse_instants(hand, self._joints, offset, slow=True)
        return ConventionSearch(self._model, seen.joints, seen.position, seen.quaternion)

    def _other_bodies(self) -> Iterator[tuple[PoseStream, PoseSource]]:
        """Every other body that was recorded, and where: those of the mapping, and in a bag every
        topic with poses.
        """
        for role, where in self._told.bodies.items():
            if role != "hand" and not where.fixed:
                yield self._recording.bodies[role], where
        if not self._where.topic:
            return
        known = {where.topic for where in self._told.bodies.values()}
        with BagReader(self._path) as bag:
            topics = sorted(set(filled_topics(bag, *BODY_TYPES)) - known)
        for topic in topics:
            one = RecordingMapping(
                {"hand": replace(_as_it_stands(self._told).bodies["hand"], topic=topic, frame="")}
            )
            # of a topic that cannot be read, as of poses in several frames, nothing is known
            with suppress(ValueError):
                yield (
                    read_recording(self._path, one, mend=False).bodies["hand"],
                    replace(self._where, topic=topic, frame=""),
                )

    def _hopeless(self, offset: ClockOffset, found: Explanation) -> Cause:
        if max(offset.correlation, offset.as_stamped) < SAME_MOVEMENTS:
            return Cause(
                "arm and hand do not move at the same times, whatever their clocks say: are both"
                " of the same session, and is it the hand?"
            )
        far = f"{100 * found.positions.error:.1f} cm"
        return Cause(
            "they move at the same times, but no order, unit, sign or zero of the joints and no"
            f" axes explain where: the best leaves {far}. Is it another arm than config/wam.yaml"
            " describes, or does the body not sit on its hand?"
        )

    # clocks

    def _set(self, change: Change, least: float = 0.0) -> None:
        """Set the clock right whose stamps leap so; if none does, the one with which the ball
        leaves the hand when this is opened.

        * change: of the offset.
        * least: smaller ones without a leap are not taken, as places tell them better than
          movements [s].
        """
        by = round(1e9 * change.by)
        is_cameras, (row, their_row) = rows_of_change(
            change, self._hand.stamp_ns, self._joints.stamp_ns, self._was
        )
        stamps = self._hand.stamp_ns + np.where(np.arange(len(self._hand)) >= row, by, 0)
        if is_cameras is None:
            if abs(change.by) < least:
                return
            is_cameras = self._untimely(stamps) <= self._untimely(self._hand.stamp_ns)
        if is_cameras:
            self._hand = replace(self._hand, stamp_ns=stamps)
        else:
            theirs = self._joints.stamp_ns
            self._joints = replace(
                self._joints,
                stamp_ns=theirs - np.where(np.arange(len(theirs)) >= their_row, by, 0),
            )

    def _blame_steps(self) -> None:
        """The clock that was set, and that of the arm's commands, if it is the same."""
        told = {"axes": self._where, "joints": self._told.joints}
        for (section, where), stamps, was in zip(
            told.items(), (self._hand.stamp_ns, self._joints.stamp_ns), self._was, strict=True
        ):
            steps = steps_of(stamps, was)
            if where is None or steps == [list(one) for one in where.clock.steps]:
                continue
            times = " and ".join(f"by {-by:.3f} s at {at:.3f} s" for at, by in steps)
            whose = {"axes": "cameras", "joints": "joints"}[section]
            self._blame(
                f"the clock of the {whose} was set meanwhile, {times or 'not at all'}",
                section,
                time_steps=steps,
            )
            if section == "joints" and self._untimely(
                self._hand.stamp_ns, steps
            ) < LIKELY * self._untimely(self._hand.stamp_ns):
                for name in ("teacher", "command"):
                    if getattr(self._told, name) is not None:
                        self._blame(f"that of the {name} likewise", name, time_steps=steps)

    def _untimely(self, stamps: np.ndarray, steps: Sequence[Sequence[float]] = ()) -> float:
        """By how much the time differs from the command to open the hand until the ball has left
        it [s].

        * stamps: of the hand, set right (n,) [ns].
        * steps: of the clock of the commands.
        """
        late = np.array(self._lateness_of_releases(stamps, steps))
        missing = len(self._recording.openings) - len(late)
        return (
            float(np.sum(np.minimum(np.abs(late - np.median(late)), SOON))) + SOON * missing
            if len(late)
            else np.inf
        )

    def _blame_clocks(self, late: float, drift: float, steady: bool) -> None:
        if not steady:
            self._blame(UNCLEAR_STEPS)
        ours, theirs = 1e-9 * self._where.clock.shift_ns, 1e-9 * self._told.joints.clock.shift_ns  # type: ignore[union-attr]
        if drift:
            goes = "gains" if drift > 0.0 else "loses"
            text = (
                f"the clock of the joints {goes} {1e3 * abs(drift):.3f} ms a second on that of the"
                " cameras"
            )
            share = 1.0 / (1.0 + drift)
            self._blame(
                text,
                "joints",
                time_drift=round(-drift * share, 9),
                time_shift=round(ours - late * share, 6),
            )
        elif abs(late - self._told_offset) > LATE:
            apart = late - self._told_offset
            span = f"{1e3 * abs(apart):.0f} ms" if abs(apart) < 10.0 else f"{abs(apart):.1f} s"
            by = f"{span} {'late' if apart > 0.0 else 'early'}"
            if self._hand_opens_in_time():
                self._blame(
                    f"the stamps of the joints are {by} against those of the cameras",
                    "joints",
                    time_shift=round(ours - late, 6),
                )
            else:
                text = f"the clock of the arm is {by} against that of the cameras"
                self._blame(text, "axes", time_shift=round(late + theirs, 6))

    def _with_clocks(
        self, found: Explanation, coarse: float
    ) -> tuple[Explanation, float, float, bool]:
        """The explanation once clocks are mended, the joints' stamps after the cameras' at the
        first one [s], what is added each second, and whether that is all. Each round knows the
        clocks better, and so the hand.
        """
        first = int(self._joints.stamp_ns[0])
        late, drift, may_be_set = coarse, 0.0, self.is_set
        for _ in range(CLOCK_ROUNDS):
            recorded = self._joints
            stamps = first + np.rint(
                ((recorded.stamp_ns - first) - 1e9 * late) / (1.0 + drift)
            ).astype(np.int64)
            self._joints = replace(recorded, stamp_ns=stamps)
            found = self._search(self._hand, 0.0).explain(found.convention, STARTS)
            more, faster, steady = self._lateness(found, 0.0 if drift else STEADY)
            small = self._small_changes(found) if may_be_set or not steady else []
            self._aligned, self._joints = self._joints, recorded
            may_be_set = False
            if small:
                for change in small:
                    self._set(replace(change, before=change.before + late))
                continue
            if not steady or (abs(more) < FINE and not faster):
                break
            late, drift = late + (1.0 + drift) * more, (1.0 + drift) * (1.0 + faster) - 1.0
        return found, late, drift, steady

    def _small_changes(self, found: Explanation) -> list[Change]:
        """Changes of the offset that show in where the hand is."""
        fit, stamps = found.positions, self._joints.stamp_ns
        rows = evenly_spaced(len(stamps), 20 * LOOKED_AT)
        joints = found.convention.joints(self._joints.position[rows])
        place, rotation, _ = self._model.hand_states(joints, np.zeros_like(joints))
        path = JointStream(stamps[rows], place + rotation @ fit.lever, self._joints.velocity[rows])
        seen = at_instants(
            self._hand.take(evenly_spaced(len(self._hand), LOOKED_AT)),
            path,
            0.0,
        )
        back = (seen.position - fit.shift) @ fit.world / fit.scale
        offsets = np.arange(-REACH, REACH + FINE, 2.0 * FINE)
        apart = [
            np.linalg.norm(back - joints_at(path, seen.seconds + one)[0], axis=1)
            for one in offsets
        ]
        cost = np.minimum(np.array(apart).T / AGREED_POSITION, FARTHEST) ** 2
        return changes(
            stamps[0] + 1e9 * seen.seconds, offsets, cost, CHANGE * FARTHEST**2, FARTHEST
        )

    def _lateness(self, found: Explanation, tolerated: float) -> tuple[float, float, bool]:
        """The joints' stamps after the cameras' at the first one of the recorded joints [s], what
        is added each second, and whether that is all. tolerated: difference between parts up to
        which nothing is added [s].
        """
        instants = diverse_instants(self._hand, self._joints, 0.0, slow=False)
        offsets = np.arange(-REACH, REACH + FINE, FINE)
        # (offsets, instants)
        misfit = np.array([self._misfit(found, instants, one) for one in offsets])
        best = float(offsets[np.argmin(np.nanmean(misfit, axis=1))])
        pieces = [
            rows for rows in np.array_split(np.argsort(instants.seconds), PIECES) if len(rows) >= 4
        ]
        lates = np.array(
            [offsets[np.argmin(np.nanmean(misfit[:, rows], axis=1))] for rows in pieces]
        )
        if len(pieces) < 3 or np.ptp(lates) <= tolerated:
            return best, 0.0, True
        times = np.array([instants.seconds[rows].mean() for rows in pieces])
        slope, start = np.polyfit(times, lates, 1)
        steady = bool(np.abs(start + slope * times - lates).max() < STEADY)
        since = 1e-9 * float(self._recording.joints.stamp_ns[0] - self._joints.stamp_ns[0])  # type: ignore[union-attr]
        return (float(start + slope * since), float(slope), True) if steady else (best, 0.0, False)

    def _misfit(self, found: Explanation, instants: Instants, offset: float) -> np.ndarray:
        """Distances (n,) between the hand by the joints with an offset and as the cameras saw it;
        nan without joints.
        """
        fit = found.positions
        values, known = joints_at(self._joints, instants.seconds + offset)
        joints = found.convention.joints(np.where(known[:, None], values, 0.0))
        place, rotation, _ = self._model.hand_states(joints, np.zeros_like(joints))
        back = (instants.position - fit.shift) @ fit.world / fit.scale
        return np.where(known, np.linalg.norm(back - place - rotation @ fit.lever, axis=1), np.nan)

    def _hand_opens_in_time(self) -> bool:
        """Whether the ball leaves the hand soon after the arm was told to open it: then arm and
        cameras have one clock.
        """
        late = self._lateness_of_releases(
            self._hand.stamp_ns, self._mending["command"].get("time_steps", ())
        )
        return not late or bool(np.median(late) < SOON)

    def _lateness_of_releases(
        self, stamps: np.ndarray, steps: Sequence[Sequence[float]]
    ) -> list[float]:
        """How long after each command to open the hand the ball has left it [s], where it has
        soon. stamps, steps: as of `_untimely`.
        """
        ball = self._recording.bodies["ball"]
        ball_stamps = _clock(steps_of(stamps, self._was[0])).corrected(ball.stamp_ns)
        late = []
        for opening in (
            _clock(steps)
            .corrected(np.array([one.stamp_ns for one in self._recording.openings]))
            .tolist()
        ):
            rows = np.flatnonzero((stamps >= opening) & (stamps < opening + 2_000_000_000))
            if not len(rows) or not len(ball):
                continue
            nearest = np.clip(np.searchsorted(ball_stamps, stamps[rows]), 0, len(ball) - 1)
            apart = (
                np.linalg.norm(ball.position[nearest] - self._hand.position[rows], axis=1)
                * LENGTH_UNITS[self._where.length]
            )
            if apart[0] < AWAY and (apart > AWAY).any():
                late.append(1e-9 * float(stamps[rows[np.argmax(apart > AWAY)]] - opening))
        return late

    # joints

    def _blame_joints(self, found: JointConvention) -> None:
        told, numbers = self._convention, range(1, joint_count() + 1)
        if found.angle != told.angle:
            name = {"deg": "degrees", "rad": "radians"}[found.angle]
            self._blame(f"the joints are in {name}", "joints", angle=found.angle)
        if found.order != told.order:
            self._blame(
                "the joints are recorded in another order", "joints", **self._in_order(found.order)
            )
        if found.signs != told.signs:
            other = [
                str(k)
                for k, was, now in zip(numbers, told.signs, found.signs, strict=True)
                if was != now
            ]
            self._blame(
                f"joints are counted the other way: {', '.join(other)}",
                "joints",
                signs=[int(one) for one in found.signs],
            )
        if found.zeros != told.zeros:
            other = [
                f"{k} by {np.degrees(now - was):.1f} degrees"
                for k, was, now in zip(numbers, told.zeros, found.zeros, strict=True)
                if was != now
            ]
            self._blame(
                f"joints have other zeros: {', '.join(other)}",
                "joints",
                zeros=[round(one, 4) for one in found.zeros],
            )

    def _in_order(self, order: Sequence[int]) -> dict[str, Any]:
        """The keys of a mapping that put the recorded joints in order."""
        table = self._told.joints.table if self._told.joints is not None else None
        if table is None:
            return {"names": [self._joints.names[k] for k in order]}
        return {
            "columns": {
                name: [found[k] for k in order]
                for name, found in table.columns.items()
                if len(found) == joint_count()
            }
        }

    # positions

    def _blame_positions(self, found: Explanation) -> tuple[np.ndarray, Axes]:
        """Unit, axes and place of the cameras' world; returns the turn (3, 3) of a mapping, and
        the axes of positions.
        """
        fit, where = found.positions, self._where
        unit = min(LENGTH_UNITS, key=lambda one: abs(np.log(fit.scale * LENGTH_UNITS[one])))
        if abs(fit.scale * LENGTH_UNITS[unit] - 1.0) > UNIT_ERROR:
            self._blame(
                f"a metre of the arm is {fit.scale:.4g} of the cameras: calibrate them, or is it"
                " another arm?"
            )
        elif unit != ("m" if where.capture else where.length):
            self._blame(f"positions are in {UNIT_NAMES[unit]}", "axes", length=unit)
        to_arm = fit.world.T
        shift = -to_arm @ fit.shift / fit.scale
        told = _matrix(where.axes)
        told_turn = matrices(where.world.quaternion)
        if (
            np.linalg.det(told) * np.linalg.det(to_arm) > 0.0
            and _turn(told_turn @ told @ fit.world) < TURNED
        ):
            if np.linalg.norm(shift - where.world.position) < MOVED:
                return told_turn, where.axes
        axes = where.axes if _is_near(to_arm, told) else nearest_axes(to_arm)
        if axes != where.axes:
            up = next((name for name, one in UP_AXES.items() if one == axes), "")
            keys = {"up": up} if up else {"xyz": list(axes)}
            self._blame(_pointing(axes), "axes", **keys)
        turn = to_arm @ _matrix(axes).T
        if _turn(turn) < TURNED and np.linalg.norm(shift) < MOVED:
            if where.world.position.any() or _turn(told_turn) > 0.0:
                self._blame(
                    "the base of the arm stands where our axes begin",
                    "axes",
                    transform={"position": [0.0, 0.0, 0.0]},
                )
            return np.eye(3), axes
        text = (
            "the base of the arm stands elsewhere in the world of the cameras, turned by"
            f" {np.degrees(_turn(turn)):.0f} degrees"
        )
        self._blame(text, "axes", transform=_rigid(shift, turn))
        return turn, axes

    # orientations

    def _blame_orientations(self, found: Explanation, world: tuple[np.ndarray, Axes]) -> None:
        turn, axes = world
        reading, fit, where = found.reading, found.orientations, self._where
        if reading is None or fit is None:
            self._blame(
                "the hand has no orientation: track it as a rigid body of at least three markers"
            )
            return
        if reading.order != where.order:
            self._blame(
                f"quaternions are told as {', '.join(reading.order)}", "axes", order=reading.order
            )
        if reading.is_inverse != where.is_inverse:
            self._blame(
                "orientations turn the world into the body", "axes", inverse=reading.is_inverse
            )
        needed = (-1.0 if reading.is_mirrored else 1.0) * turn.T @ fit.world.T
        told = where.orientation_axes or axes
        if not _is_near(needed, _matrix(told), APART):
            nearest = nearest_axes(needed)
            if not _is_near(needed, _matrix(nearest), APART):
                self._blame(
                    "positions and orientations are told in worlds that are turned against each"
                    " other"
                )
            else:
                text = "orientations are told in other axes than positions"
                self._blame(text, "axes", orientation_xyz=list(nearest))
        self._blame_body(fit.hand, found.positions.lever)

    def _blame_leaps(self, found: Explanation) -> None:
        fit, reading = found.orientations, found.reading
        if fit is None or reading is None:
            return
        rows = evenly_spaced(len(self._hand), LOOKED_AT)
        every = at_instants(self._hand.take(rows), self._aligned, 0.0)
        turned = np.isfinite(every.quaternion).all(axis=1)
        joints = found.convention.joints(every.joints[turned])
        _, rotation, _ = self._model.hand_states(joints, np.zeros_like(joints))
        apart = turn_angles(
            (fit.world @ rotation @ fit.hand).transpose(0, 2, 1)
            @ reading.rotations(every.quaternion[turned])
        )
        leaps = apart > LEAP
        if np.mean(leaps) >= FEWEST_LEAPS:
            self._blame(
                "the orientation of the hand leaps to another solution in"
                f" {100 * np.mean(leaps):.0f} % of the frames, turned by"
                f" {np.degrees(np.median(apart[leaps])):.0f} degrees: arrange its markers so that"
                " no turn makes them look the same"
            )

    def _blame_body(self, hand: np.ndarray, lever: np.ndarray) -> None:
        """How the tracked body sits on the hand, if that is not as the mapping says."""
        told = self._where.offset
        turned, shift = hand.T, -hand.T @ lever
        if (
            _turn(turned.T @ matrices(told.quaternion)) > TURNED
            or np.linalg.norm(shift - told.position) > MOVED
        ):
            text = (
                f"the tracked body sits otherwise on the hand, {100 * np.linalg.norm(lever):.0f}"
                " cm away and turned by"
            )
            self._blame(
                f"{text} {np.degrees(_turn(turned)):.0f} degrees",
                "hand",
                offset=_rigid(shift, turned),
            )

    def _mended(self) -> RecordingMapping:
        """The mapping with all that mends the recording."""
        told, axes, joints = self._told, self._mending["axes"], self._mending["joints"]
        sources = dict(told.bodies)
        # what the mapping takes for the hand stands for the body that is
        if self._is_hand is not None:
            sources = {
                role: self._where if where is self._is_hand else where
                for role, where in sources.items()
            }
            sources["hand"] = self._is_hand
        bodies = {
            role: where if where.fixed else mended_pose(where, axes)
            for role, where in sources.items()
        }
        bodies["hand"] = mended_pose(bodies["hand"], self._mending["hand"])
        assert told.joints is not None  # as it was read
        teacher, command = (
            where and mended_joints(where, self._mending[name])
            for name, where in (("teacher", told.teacher), ("command", told.command))
        )
        joints_source = mended_joints(told.joints, joints)
        return replace(told, bodies=bodies, joints=joints_source, teacher=teacher, command=command)


def _matrix(axes: Axes) -> np.ndarray:
    found = axes_matrix(axes)
    assert found is not None  # as `Axes` are
    return found


def _clock(steps: Sequence[Sequence[float]]) -> Clock:
    return Clock(steps=tuple((at, by) for at, by in steps))


def _turn(rotation: np.ndarray) -> float:
    """Angle of a rotation (3, 3) [rad]."""
    return float(turn_angles(rotation[None])[0])


def _is_near(one: np.ndarray, other: np.ndarray, within: float = np.pi / 4.0) -> bool:
    """Whether two orthogonal matrices are turned by less than an angle [rad] against each other,
    and mirrored alike.
    """
    between = one @ other.T
    return bool(np.linalg.det(between) > 0.0) and _turn(between) < within


def _rigid(position: np.ndarray, rotation: np.ndarray) -> dict[str, list[float]]:
    quaternion = of_matrices(rotation[None])[0]
    return {
        "position": np.round(position, 4).tolist(),
        "quaternion": np.round(quaternion, 5).tolist(),
    }


def _pointing(axes: Axes) -> str:
    if axes == AS_OURS:
        return "positions are told in our own axes"
    handed = "left-handed axes" if np.linalg.det(_matrix(axes)) < 0.0 else "other axes"
    return f"positions are told in {handed}: our x, y, z are their {', '.join(axes)}"
