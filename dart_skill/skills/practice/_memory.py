"""Practice (thesis 8.2): every throw that the arm makes is a demonstration of how to hit the place
where the ball really came down.

A trial joins the demonstrations if it can be read and resembles them; otherwise it is kept out,
with the reason. A memory that is full forgets, by age or by crowding; what the teacher showed is
forgotten last.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dart_skill.movement import AlignmentFit, check_alignment, find_patterns, turn_matrix
from dart_skill.recording import Demonstration
from dart_skill.skills.learning import (
    DEFAULT,
    Coverage,
    PreparedThrow,
    ThrowingSkill,
    ThrowSettings,
    learn_prepared,
    prepare,
)
from dart_skill.skills.protocol import Skill

FORGETTING = ("oldest", "crowded")
LEAST_TO_COMPARE = 4
MOST_FOR_PATTERNS = 30
"""Every demonstration is compared with every other one, which takes 0.1 s for so many."""


@dataclass(frozen=True)
class PracticeSettings:
    """How `TrialMemory` keeps its memory, and what it takes for strange.

    Parameters
    ----------
    capacity
        Of the memory, demonstrations included, 0 for no limit.
    forget
        "oldest" trial first, or "crowded": the older of the two whose tasks are nearest to each
        other, which keeps the region covered.
    largest_deviation
        From what the others predict, in units of what is usual.
    tolerance
        A hand path that strays less is never strange [m].
    tail
        So long after the release the motion does not matter [s].
    """

    capacity: int = 0
    forget: str = "oldest"
    largest_deviation: float = 8.0
    tolerance: float = 0.005
    tail: float = 0.05

    def __post_init__(self) -> None:
        if self.capacity < 0:
            raise ValueError(
                f"capacity is {self.capacity}; it must be 0, for no limit, or positive"
            )
        if self.forget not in FORGETTING:
            raise ValueError(f"forget is '{self.forget}': choose one of {', '.join(FORGETTING)}")
        if not (self.largest_deviation > 0.0 and self.tolerance >= 0.0 and self.tail >= 0.0):
            raise ValueError(
                f"largest_deviation {self.largest_deviation} must be positive, tolerance"
                f" {self.tolerance} and tail {self.tail} not negative"
            )


@dataclass(frozen=True)
class Verdict:
    """What became of a trial: kept, or kept out for a reason; ids of what was forgotten for it."""

    kept: bool
    reason: str = ""
    forgotten: tuple[str, ...] = ()


class TrialMemory:
    """The memory that a skill is learned from.

    Parameters
    ----------
    shown
        Demonstrations of a teacher.
    configuration
        ThrowSettings, default `DEFAULT`.
    settings
        PracticeSettings, default None: the default ones.
    tried
        Own throws, oldest first.
    skill
        That is learned, which may have parts of its own.

    Attributes
    ----------
    demonstrations
        What was shown, then what was tried, but for what cannot be read.
    kept_out
        Reason why a demonstration or trial is not learned from, by its id.
    """

    def __init__(
        self,
        shown: Sequence[Demonstration],
        configuration: ThrowSettings = DEFAULT,
        settings: PracticeSettings | None = None,
        tried: Sequence[Demonstration] = (),
        skill: Skill | None = None,
    ):
        self.configuration, self.settings = configuration, settings or PracticeSettings()
        self.skill = skill
        self._prepared: dict[str, PreparedThrow] = {}
        self.kept_out: dict[str, str] = {}
        self._shown, self._tried = self._readable(shown), self._readable(tried)

    def _readable(self, demonstrations: Sequence[Demonstration]) -> list[Demonstration]:
        """Those that can be learned from; of the others it is noted why not."""
        for one in demonstrations:
            if one.id in self._prepared or one.id in self.kept_out:
                raise ValueError(
                    f"two demonstrations have the id {one.id}: give every one its own"
                )
            try:
                self._prepared[one.id] = prepare(one, self.configuration)
            except ValueError as error:
                self.kept_out[one.id] = str(error)
        return [one for one in demonstrations if one.id in self._prepared]

    @property
    def demonstrations(self) -> list[Demonstration]:
        return [*self._shown, *self._tried]

    @property
    def n_shown(self) -> int:
        """How many of the demonstrations, the first ones, were shown by a teacher."""
        return len(self._shown)

    def learn(self) -> ThrowingSkill:
        """The skill that all these demonstrations teach; each is prepared only once.

        Raises
        ------
        ValueError
            If they are too few, and what is wrong with the others.
        """
        try:
            throws = [self._prepared[one.id] for one in self.demonstrations]
            return learn_prepared(throws, self.configuration, self.skill)
        except ValueError as error:
            raise ValueError("; ".join([str(error), *self.kept_out.values()])) from error

    def add(self, trial: Demonstration) -> Verdict:
        """Judge a trial and remember it if it will do; its task is where it landed, not where it
        was aimed.
        """
        reason, prepared = self._judge(trial)
        if reason or prepared is None:
            self.kept_out[trial.id] = reason
            return Verdict(False, reason)
        self._tried.append(trial)
        self._prepared[trial.id] = prepared
        return Verdict(True, forgotten=tuple(self._forget()))

    def patterns(self) -> str:
        """Groups of what was shown whose hand paths are clearly apart though they reach equally
        far, in words; empty if there are none.

        A skill learned from a throw over the shoulder and one from below throws like neither.
        """
        throws = [self._prepared[one.id] for one in self._shown]
        if not LEAST_TO_COMPARE <= len(throws) <= MOST_FOR_PATTERNS:
            return ""
        groups = find_patterns([self._path(throw)[1] for throw in throws]).groups
        reaches = [[throws[i].reach for i in group] for group in groups]
        if len(groups) < 2 or max(map(min, reaches)) > min(map(max, reaches)):
            return ""
        named = "; ".join(", ".join(throws[i].id for i in group) for group in groups)
        return f"{len(groups)} ways of throwing were shown, and learned as one: {named}"

    def withdraw(self, trial_id: str, reason: str) -> None:
        """Take back a trial that was kept but cannot be learned from.

        Parameters
        ----------
        trial_id
            Of the trial.
        reason
            In words.
        """
        self._tried = [one for one in self._tried if one.id != trial_id]
        self._prepared.pop(trial_id, None)
        self.kept_out[trial_id] = reason

    def _judge(self, trial: Demonstration) -> tuple[str, PreparedThrow | None]:
        if trial.id in self._prepared:
            return f"there is a demonstration {trial.id} already", None
        try:
            prepared = prepare(trial, self.configuration)
        except ValueError as error:
            return str(error), None
        fit = self._compare(prepared)
        return (
            ""
            if fit is None or fit.fits
            else f"trial {trial.id} does not resemble the demonstrations: {fit.reason}"
        ), prepared

    def _compare(self, trial: PreparedThrow) -> AlignmentFit | None:
        """The trial's hand path against the others', in axes turned to their tasks, for the
        distance it landed at.
        """
        throws = [*self._prepared.values(), trial]
        if len(throws) < LEAST_TO_COMPARE:
            return None
        clocks, paths = zip(*(self._path(throw) for throw in throws), strict=True)
        distances = np.array([[throw.reach] for throw in throws])
        return check_alignment(
            clocks,
            paths,
            distances,
            largest_deviation=self.settings.largest_deviation,
            tolerance=self.settings.tolerance,
        )[-1]

    def _path(self, throw: PreparedThrow) -> tuple[np.ndarray, np.ndarray]:
        until = throw.time <= throw.release_time + self.settings.tail
        return throw.time[until], throw.motion[until, :3] @ turn_matrix(throw.azimuth)

    def _forget(self) -> list[str]:
        forgotten = []
        while (
            self.settings.capacity
            and len(self.demonstrations) > self.settings.capacity
            and len(self.demonstrations) > 2
        ):
            from_memory = self._tried if len(self._tried) > 1 else (self._shown or self._tried)
            index = 0 if self.settings.forget == "oldest" else self._most_crowded(from_memory)
            forgotten.append(from_memory.pop(index).id)
            del self._prepared[forgotten[-1]]
        return forgotten

    def _most_crowded(self, memory: list[Demonstration]) -> int:
        """Index of the older of the two whose tasks are nearest to each other."""
        return Coverage(np.array([self._prepared[one.id].task for one in memory])).most_crowded()
