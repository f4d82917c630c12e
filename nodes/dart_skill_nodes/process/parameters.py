"""A row of the table in which a node says what its parameters are."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """One row of a node's parameter table; the value stands in config/. low and high bound
    numbers.
    """

    name: str
    description: str
    low: float | None = None
    high: float | None = None
    read_only: bool = True
