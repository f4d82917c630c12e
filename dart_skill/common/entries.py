"""What the entries of a file may be: numbers in a range, texts, lists and names with values of
these kinds. A kind checks a value, and an error names file, entry and remedy.
"""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Protocol


class ConfigurationError(ValueError):
    """A file of config/ is not as it must be."""


class Kind(Protocol):
    """What an entry may be."""

    def check(self, value: Any, name: str) -> None:
        """ConfigurationError if a value is none of this kind.

        Parameters
        ----------
        name
            What it is called in an error.
        """


def wrong(value: Any, name: str, wanted: str) -> ConfigurationError:
    """The error for a value that is not what an entry must be.

    Parameters
    ----------
    name
        Of the entry, with its file.
    wanted
        What it must be.
    """
    return ConfigurationError(f"{name} is {reprlib.repr(value)}; it must be {wanted}")


@dataclass(frozen=True)
class Number:
    """A finite number from `low` to `high`.

    Parameters
    ----------
    whole
        Whether it must be an integer.
    """

    low: float
    high: float
    whole: bool = False

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        wanted = int if self.whole else (int, float)
        number = isinstance(value, wanted) and not isinstance(value, bool)
        if not (number and self.low <= value <= self.high):
            which = "an integer" if self.whole else "a number"
            raise wrong(value, name, f"{which} from {self.low:g} to {self.high:g}")


@dataclass(frozen=True)
class Text:
    """A text.

    Parameters
    ----------
    filled
        Whether it must not be empty.
    """

    filled: bool = False

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        if not isinstance(value, str) or (self.filled and not value):
            raise wrong(value, name, "a name" if self.filled else "a text")


@dataclass(frozen=True)
class OneOf:
    """One of some texts."""

    choices: tuple[str, ...]

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        if not isinstance(value, str) or value not in self.choices:
            raise wrong(value, name, f"one of {', '.join(self.choices)}")


@dataclass(frozen=True)
class Flag:
    """True or false."""

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        if not isinstance(value, bool):
            raise wrong(value, name, "true or false")


@dataclass(frozen=True)
class Rows:
    """A list of values of one kind.

    Parameters
    ----------
    of
        Their kind.
    counts
        How many there may be; empty: one or more.
    """

    of: Kind
    counts: tuple[int, ...] = ()

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        fits = isinstance(value, list) and (len(value) in self.counts if self.counts else value)
        if not fits:
            count = " or ".join(map(str, self.counts))
            raise wrong(value, name, f"a list of {count}" if count else "a list, not an empty one")
        for k, one in enumerate(value):
            self.of.check(one, f"{name}[{k}]")


@dataclass(frozen=True)
class Each:
    """Values of one kind by any names."""

    of: Kind

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        check_names(value, name)
        for key, one in value.items():
            self.of.check(one, _below(name, key))


@dataclass(frozen=True)
class Entries:
    """Names, each with a value of its own kind; no others.

    Parameters
    ----------
    needed, optional
        Kinds by the names that must, and that may be there.
    """

    needed: Mapping[str, Kind] = field(default_factory=dict)
    optional: Mapping[str, Kind] = field(default_factory=dict)

    def check(self, value: Any, name: str) -> None:
        """See `Kind`.

        Raises
        ------
        ConfigurationError
            For a name that is unknown, or missing, too.
        """
        check_names(value, name)
        known = {**self.needed, **self.optional}
        for key in value:
            if key not in known:
                near = get_close_matches(key, known, n=1)
                meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
                raise ConfigurationError(f"{name} has an unknown entry {key!r}: {meant}")
        if missing := [key for key in self.needed if key not in value]:
            raise ConfigurationError(f"{name} lacks {', '.join(missing)}: add it")
        for key, one in value.items():
            known[key].check(one, _below(name, key))


class Anything:
    """Any value, which is checked elsewhere."""

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""


ANYTHING = Anything()


@dataclass(frozen=True)
class EitherOf:
    """A value of one of several kinds.

    Parameters
    ----------
    wanted
        What an error says that it must be.
    """

    kinds: tuple[Kind, ...]
    wanted: str

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        if not any(self._fits(kind, value, name) for kind in self.kinds):
            raise wrong(value, name, self.wanted)

    @staticmethod
    def _fits(kind: Kind, value: Any, name: str) -> bool:
        try:
            kind.check(value, name)
        except ConfigurationError:
            return False
        return True


def check_names(value: Any, name: str) -> None:
    """ConfigurationError unless a value has names with values."""
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise wrong(value, name, "names with values, as 'name: value'")


def _below(name: str, key: str) -> str:
    """Name of an entry of what has a name itself, which is that of a file at first."""
    return f"{name}.{key}" if ": " in name else f"{name}: {key}"
