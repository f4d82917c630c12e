"""Where baskets stand: the region that the arm can throw to, and targets spread over it.

The far end is where a throw takes 60 % of the no-load speed of J2 and J4: beyond it the teacher's
swing runs into the motors' torque-speed line. The near end is where the swing is so slow that the
ball comes down almost beside the arm.
"""

from dataclasses import dataclass

import numpy as np

from dart_skill.common.world import the_world


@dataclass(frozen=True)
class Region:
    """A sector in front of the arm: distances from the base axis [m], azimuths to either side
    [rad], height of the rim [m].
    """

    near: float
    far: float
    side: float
    rim: float

    def spread(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Baskets (n, 3): azimuths and distances in n strata, each used once in random order,
        uniform inside.
        """
        azimuths = self.side * (2 * (rng.permutation(n) + rng.random(n)) / max(n, 1) - 1)
        distances = self.near + (self.far - self.near) * (
            rng.permutation(n) + rng.random(n)
        ) / max(n, 1)
        return np.column_stack(
            [distances * np.cos(azimuths), distances * np.sin(azimuths), np.full(n, self.rim)]
        )


REGION = Region(the_world().near, the_world().far, the_world().side, the_world().rim)
"""That of config/world.yaml."""


def targets_for(
    seed: int, demonstrations: int, throws: int, region: Region = REGION
) -> tuple[np.ndarray, np.ndarray]:
    """Baskets to demonstrate (n, 3) and other ones to throw at (m, 3), from one seed."""
    to_demonstrate, to_throw = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    return region.spread(demonstrations, to_demonstrate), region.spread(throws, to_throw)
