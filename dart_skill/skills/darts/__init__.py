"""Throw darts at a regulation board, and learn what to aim at (chapter 6).

How to throw is learned as for baskets (`skills.throw`); here is what differs: a dart instead of a
ball, an upright board that hangs where config/world.yaml says, and practice that moves the release
to where the delay of the hand matters least.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dart_skill.arm import DART, ArmDescription
from dart_skill.common.situation import Pose, Situation
from dart_skill.common.surface import BOARD_DIAMETER, BoardFace
from dart_skill.common.world import the_world
from dart_skill.darts import place_of, score
from dart_skill.skills.practice import CorrectionSettings
from dart_skill.skills.protocol import Skill, SkillSettings, SkillWords, Solid, ThrowSettings
from dart_skill.skills.throw import Throw

if TYPE_CHECKING:
    from dart_skill.darts import ModelBasedAgent

AIM = ("right", "up")
"""Numbers of a situation: where the dart shall hit, from the bull, as the thrower sees the board
[m].
"""
FARTHEST_AIM = BOARD_DIAMETER
"""Largest distance of an aim from the bull [m]."""


SEEN = 0.014
"""Radius of the point that viewers show of a dart [m]."""


@dataclass(frozen=True)
class DartsSettings(ThrowSettings):
    """Beside those of every skill that throws:

    Parameters
    ----------
    by_motion
        See `ThrowSettings`: the scatter of a hand is as wide as what is aimed at.
    step
        Of a plan [s]: finer than of a basket's, since its release is moved by milliseconds.
    shown
        Half the height and width of the part of the board that is aimed at when it is shown [m].
    cocked
        Angles of J2, J4 and J6 before the swing of a simulated person (3,) [rad].
    offsets, lengths, turns, apart, farthest, memory
        How misses are learned from (`CorrectionSettings`).
    steady_every
        Own throws between two looks at when to let go; 0: that is not practised.
    window
        Darts from which the own spread is estimated.
    least
        Before the first estimate.
    every
        Between two estimates.
    tolerance
        The board may hang so far from where config/world.yaml has it [m].
    """

    refinement: str = "aim"
    targets: str = "best_aim"
    by_motion: bool = field(default=True, repr=False)
    step: float = 0.002
    shown: float = 0.12
    cocked: tuple[float, ...] = (-1.00, -0.42, -0.60)
    offsets: tuple[float, ...] = (0.05,)
    lengths: tuple[float, ...] = (0.2,)
    turns: tuple[float, ...] = (0.1,)
    apart: tuple[float, ...] = (1e-6, 1e-6)
    farthest: float = 0.15
    memory: int = 40
    steady_every: int = 25
    window: int = 50
    least: int = 10
    every: int = 5
    tolerance: float = 0.02

    SIGNED: ClassVar[frozenset[str]] = ThrowSettings.SIGNED | {"cocked"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.cocked) != 3:
            raise ValueError(f"cocked is {self.cocked}; it must be three angles")
        if len(self.apart) != 2:
            raise ValueError(f"apart is {self.apart}; it must be two numbers")
        if not self.shown > 0.0:
            raise ValueError(f"shown is {self.shown}; it must be positive")
        self.correction()

    def correction(self) -> CorrectionSettings:
        """How misses are learned from."""
        apart = float(self.apart[0]), float(self.apart[1])
        return CorrectionSettings(
            self.offsets,
            self.lengths,
            self.turns,
            apart=apart,
            farthest=self.farthest,
            memory=self.memory,
        )


class Darts(Throw):
    """Throw the dart in the hand at a point of the board: the situation has the numbers `right`
    and `up`, without them it is the bull.
    """

    name = "darts"
    task = "throw the dart at the board"
    bodies = ("dart", "board")
    world = "board"
    corrects = "board"
    cuts_itself = in_the_open = False
    parts = MappingProxyType(
        {
            **Throw.parts,
            "targets": {"best_aim": "dart_skill.skills.darts._target_choice:BestAim"},
        }
    )
    numbers = AIM
    units = MappingProxyType(dict.fromkeys(AIM, "m"))
    settings_type = DartsSettings
    told_by = "darts"
    settings: DartsSettings

    def __init__(self, settings: SkillSettings | None = None):
        super().__init__(settings)
        if not self.settings.board:
            self.settings = replace(self.settings, board=the_world().board_position)

    @property
    def bull(self) -> tuple[float, float, float]:
        """Where the board hangs [m]."""
        x, y, z = self.settings.board
        return x, y, z

    @classmethod
    def at_board(cls, bull: Sequence[float]) -> Darts:
        """The skill as it is configured, for a board that hangs elsewhere: its bull (3,) [m]."""
        board = tuple(float(value) for value in bull)
        one = cls.configured()
        return one.with_settings(replace(one.settings, board=board))

    @property
    def words(self) -> SkillWords:
        hang = "hang the board where board_position of config/world.yaml says, in sight of the cameras"
        return replace(
            super().words,
            stand=hang,
            lessons=8,
            tries=75,
            unit=("mm", 1000.0),
            demo_seconds=145.0,
        )

    @property
    def situated(self) -> tuple[str, ...]:
        """None: the board hangs where it hangs."""
        return ()

    @property
    def face(self) -> BoardFace:
        """The face of the board."""
        surface = self.game.surface
        assert isinstance(surface, BoardFace)
        return surface

    @property
    def cocked(self) -> tuple[float, float, float]:
        first, second, third = self.settings.cocked
        return float(first), float(second), float(third)

    @property
    def middle(self) -> tuple[float, float, float]:
        """The bull."""
        return self.bull

    @property
    def correction(self) -> CorrectionSettings:
        return self.settings.correction()

    @property
    def steady_every(self) -> int:
        return self.settings.steady_every

    def solids(self, role: str) -> Sequence[Solid]:
        return (Solid("board"),) if role == "board" else (Solid("sphere", (SEEN,)),)

    def loaded(self, description: ArmDescription) -> ArmDescription:
        """The arm with a dart in its hand."""
        return replace(description, ball=DART)

    def agent(self) -> ModelBasedAgent:
        """Who chooses what to aim at, by the spread of the own darts (6.1)."""
        # a graph that throws at baskets has a coach that knows of darts, too
        from dart_skill.darts import ModelBasedAgent

        s = self.settings
        return ModelBasedAgent(learns_from="hits", window=s.window, least=s.least, every=s.every)

    def target(self, situation: Situation) -> np.ndarray:
        aim = self._right_up(situation)
        self.check_known((), situation.numbers)
        if not np.hypot(*aim) <= FARTHEST_AIM:
            raise ValueError(
                f"the aim is {aim[0]:.3f} m to the right and {aim[1]:.3f} m up from the bull: that"
                " is not on the board"
            )
        return self.face.beside_bull(aim)

    def at(self, target: np.ndarray) -> Situation:
        return self.aimed(self.face.on_board(target))

    def aimed(self, point: np.ndarray) -> Situation:
        """The situation in which a point (2,) [mm] of the board, right and up from the bull, is
        aimed at.
        """
        right, up = 1e-3 * np.asarray(point, dtype=float)
        return Situation({}, {"right": float(right), "up": float(up)})

    def about(self, situation: Situation) -> Situation:
        self.target(situation)
        right, up = self._right_up(situation)
        return Situation({}, {"right": float(right), "up": float(up)})

    def _right_up(self, situation: Situation) -> np.ndarray:
        return np.array([situation.numbers.get(name, 0.0) for name in AIM])

    def aim(self, situation: Situation) -> np.ndarray:
        """The point (2,) [mm] of the board that is aimed at, as `dart_skill.darts` has them."""
        return 1e3 * self._right_up(situation)

    def draws(self, rng: np.random.Generator, n: int) -> list[Situation]:
        """Points to be shown: heights and sides in n strata, each used once."""
        strata = [(rng.permutation(n) + rng.random(n)) / n for _ in range(2)]
        return [
            self.aimed(point)
            for point in 1e3 * self.settings.shown * (2 * np.stack(strata, axis=1) - 1)
        ]

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A point about the bull."""
        return self.draws(rng, 1)[0]

    def check_seen(self, role: str, pose: Pose) -> None:
        """ValueError if the cameras see the board elsewhere than config/world.yaml has it."""
        away = float(np.linalg.norm(pose.position - self.face.bull))
        if role == "board" and not away <= self.settings.tolerance:
            raise ValueError(
                f"the cameras see the board at {pose.position.round(3).tolist()} m, {away:.3f} m"
                " from where config/world.yaml has its bull (board_position,"
                f" {list(self.face.bull)}): hang it there, or say there where it hangs"
            )

    def points(self, landing: np.ndarray) -> tuple[int, str]:
        """Score of a dart that met the plane of the board at a place (3,) [m], and the bed in
        which it is.

        Parameters
        ----------
        landing
            The place.
        """
        hit = self.face.on_board(landing)
        return int(score(hit)), place_of(hit)

    def situations(
        self, seed: int, shown: int, tried: int
    ) -> tuple[Iterator[Situation], Iterator[Situation]]:
        """Points of the board, drawn.

        Parameters
        ----------
        shown, tried
            How many are needed.
        """
        return Skill.situations(self, seed, shown, tried)

    def in_words(self, situation: Situation) -> str:
        """How far the aim is to the right of the bull, and how far above it."""
        return Skill.in_words(self, situation)
