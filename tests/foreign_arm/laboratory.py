"""What differs from one laboratory to the next, in one place: drawn by a seed, or left out."""

from dataclasses import dataclass, field

import numpy as np

from tests.foreign_arm import published


def _seven(value):
    return lambda: np.full(7, float(value))


@dataclass(frozen=True)
class Laboratory:
    """The nuisances of one arm, hand, camera system and person. Arrays (7,) are per joint; SI
    units.
    """

    seed: int = 0
    mass_scale: np.ndarray = field(default_factory=_seven(1.0))  # true over published link mass
    hand_mass_scale: float = 1.0
    joint_offset: np.ndarray = field(default_factory=_seven(0.0))  # measured minus true angle
    base_turn: float = 0.0  # of the base about the vertical
    coulomb: np.ndarray = field(default_factory=_seven(0.0))  # sliding friction
    stiction: float = 1.0  # breakaway over sliding friction
    stribeck_speed: float = 0.05  # at which stiction has faded to a third
    viscous: np.ndarray = field(default_factory=_seven(0.0))
    stiffness: np.ndarray | None = None  # of the cable drives between motor and link; None: rigid
    real_motors: bool = False  # torque limits and the torque-speed line
    encoder_counts: int = 0  # per turn of a motor; 0: exact
    hand_delay: float = 0.045  # from the command to the free ball
    hand_spread: float = 0.0
    ball_mass: float = 0.055
    drag_coefficient: float = 0.0
    camera_latency: float = 0.012
    camera_noise: float = 0.0
    camera_loss: float = 0.0  # share of frames that do not arrive
    registration_shift: float = 0.0  # length of the constant offset of a tracked body
    registration_turn: float = 0.0
    human: float = 0.0  # how much the person varies, 1: as people do

    @classmethod
    def quiet(cls):
        """An arm as in the books."""
        return cls()

    @classmethod
    def drawn(cls, seed):
        """One laboratory, always the same for a seed.

        Friction within a factor of 1.4 of the identified values. The drive's stiffness is chosen,
        no published value was found: it puts the arm's first elastic modes at 20 Hz and above.
        Motor encoders of 4096 counts are chosen, too.
        """
        random = np.random.default_rng([seed, 71])
        sign = random.choice([-1.0, 1.0], size=9)
        return cls(
            seed=seed,
            mass_scale=1.0 + 0.03 * random.choice([-1.0, 1.0], size=7),
            hand_mass_scale=1.0 + 0.03 * sign[7],
            joint_offset=np.deg2rad(0.3) * sign[:7],
            base_turn=np.deg2rad(1.0) * sign[8],
            coulomb=published.COULOMB * 1.4 ** random.uniform(-1.0, 1.0, 7),
            stiction=random.uniform(1.1, 1.4),
            stribeck_speed=random.uniform(0.03, 0.08),
            viscous=published.VISCOUS * 1.4 ** random.uniform(-1.0, 1.0, 7),
            stiffness=np.array([2.5e4, 2.5e4, 1e4, 6e3, 800.0, 800.0, 100.0])
            * 1.3 ** random.uniform(-1.0, 1.0, 7),
            real_motors=True,
            encoder_counts=4096,
            hand_spread=0.006,
            drag_coefficient=random.uniform(0.5, 0.6),
            camera_noise=0.0003,
            camera_loss=0.01,
            registration_shift=0.001,
            registration_turn=np.deg2rad(0.5),
            human=1.0,
        )
