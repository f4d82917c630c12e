"""The throws of a recording, of which only so many are kept whole, however long it is."""

from __future__ import annotations

from collections.abc import Iterable

from dart_skill.skills.learning import Coverage, ThrowSettings, prepare
from dart_skill.skills.observation import FoundThrow


class ThrowMemory:
    """What was found in a recording. When more throws are to be learned from than it may keep, it
    forgets the older of the two whose tasks are nearest to each other, so that the region stays
    covered; throws of the arm itself before those that were shown, as in `TrialMemory`.

    Parameters
    ----------
    capacity
        How many are kept to be learned from, 0 for all.
    configuration
        Says where the task of a throw is.

    Attributes
    ----------
    throws
        All, in the order in which they came; of those that were forgotten when, where and why.
    """

    def __init__(self, capacity: int, configuration: ThrowSettings):
        if capacity < 0:
            raise ValueError(
                f"{capacity} demonstrations cannot be remembered: give a positive number, or 0"
                " for all"
            )
        self.throws: list[FoundThrow] = []
        self._capacity, self._configuration = capacity, configuration
        # places in `throws`, by whether the throw was guided
        self._kept: dict[bool, list[int]] = {
            True: [],
            False: [],
        }
        self._crowds = {True: Coverage(), False: Coverage()}

    def take(self, throws: Iterable[FoundThrow]) -> None:
        """The next ones."""
        for throw in throws:
            self.throws.append(throw)
            if self._capacity and throw.demonstration is not None and not throw.reason:
                self._remember(throw)

    def _remember(self, throw: FoundThrow) -> None:
        assert throw.demonstration is not None
        try:
            task = prepare(throw.demonstration, self._configuration).task
        except ValueError:
            return  # who learns says why it cannot be learned from
        self._kept[throw.taught].append(len(self.throws) - 1)
        self._crowds[throw.taught].add(task)
        if sum(map(len, self._kept.values())) > self._capacity:
            self._forget()

    def _forget(self) -> None:
        taught = len(self._kept[False]) < 2 and bool(self._kept[True])
        index = self._crowds[taught].most_crowded()
        self._crowds[taught].remove(index)
        place = self._kept[taught].pop(index)
        why = (
            "forgotten, as the older of the two nearest to each other of more than"
            f" {self._capacity} (--remember)"
        )
        self.throws[place] = self.throws[place].forgotten(why)
