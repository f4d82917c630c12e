"""How a body looks, in simple solids: for viewers, and for nothing else."""

from __future__ import annotations

from dataclasses import dataclass

KINDS = {"box": 3, "sphere": 1, "cylinder": 2, "cup": 3, "board": 0}
"""Each with the number of its lengths."""


@dataclass(frozen=True)
class Solid:
    """A part of a body, in the frame of the body.

    Parameters
    ----------
    kind
        "box" with its edges; "sphere" with its radius; "cylinder" along z with radius and length;
        "cup", upright, open at the top, the middle of its floor at its centre, with inner radius,
        height and thickness; "board", a dart board that faces against its x axis.
    lengths
        Of the kind [m].
    centre
        Of the solid (3,) [m].
    """

    kind: str
    lengths: tuple[float, ...] = ()
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"no solid '{self.kind}': choose one of {', '.join(KINDS)}")
        if len(self.lengths) != KINDS[self.kind] or not all(
            length > 0.0 for length in self.lengths
        ):
            raise ValueError(
                f"a {self.kind} has {KINDS[self.kind]} positive lengths [m], not {self.lengths}"
            )
