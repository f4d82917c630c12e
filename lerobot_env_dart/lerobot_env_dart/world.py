"""The simulated arm as an environment of gymnasium: actions are where the hand is in the next frame
and whether it opens, as `dart-skill bag convert --to lerobot --action pose` writes them.
"""

from typing import Any

import gymnasium
import numpy as np

from dart_skill.session import Stepped, stepped
from dart_skill.skills.protocol import load_skill
from dart_skill.view import SceneCamera
from lerobot_env_dart.configuration_dart import ACTION, SIZES

DRAWN_EVERY = 4
"""A picture is drawn once in so many frames, and repeated between them."""
ROW = 8
"""Numbers of a body: its pose, and whether it is seen."""


class DartWorld(gymnasium.Env):
    """A world of the skill `place` or `throw`. What is observed is what the cameras see, as late and
    as noisy; whether it succeeded the simulator says.

    Parameters
    ----------
    task
        "place" or "throw".
    fps
        Actions per second.
    episode_length
        Most actions of an episode.
    wide
        Whether situations are drawn as the skill is tried, and not as it is shown.
    """

    def __init__(self, task: str, fps: int = 100, episode_length: int = 1200, wide: bool = False):
        self.task, self._fps, self._wide = task, fps, wide
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": fps}
        self.render_mode = "rgb_array"
        self._max_episode_steps = episode_length
        self._skill = load_skill(task)
        self.task_description = self._skill.task
        self.observation_space = gymnasium.spaces.Dict(
            {name: _numbers(size) for name, size in SIZES.items() if name != ACTION}
        )
        self.action_space = _numbers(SIZES[ACTION])
        self._world: Stepped | None = None
        self._camera: SceneCamera | None = None
        self._frame = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """A new world and situation, both of the seed."""
        super().reset(seed=seed)
        self.close()
        world = stepped(self._skill, int(self.np_random.integers(2**31)))
        world.begin(self._skill.draw(self.np_random, wide=self._wide), self._fps)
        self._world, self._frame = world, 0
        return self._observed(), {}

    def step(
        self, action: np.ndarray
    ) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """A frame; the reward is 1 where the episode ends in success."""
        world = self._there
        world.act(action)
        self._frame += 1
        late = self._frame >= self._max_episode_steps
        over = world.done or late
        success = over and world.succeeded
        info = {"is_success": success, "message": world.message}
        return self._observed(), float(success), world.done, late and not world.done, info

    def render(self) -> np.ndarray:
        """A picture (240, 320, 3) of the scene."""
        if self._camera is None:
            self._camera = SceneCamera(self._skill)
        if self._frame % DRAWN_EVERY == 0:
            state, environment = self._there.observed()
            rows = environment.reshape(-1, ROW)
            poses = {
                role: (row[:3], row[3:7])
                for role, row in zip(self._skill.bodies, rows, strict=True)
            }
            joints = self._there.plant.arm_state.position
            self._picture = self._camera.picture(joints, poses)
        return self._picture

    def close(self) -> None:
        """Release the physics engine."""
        if self._world is not None:
            self._world.close()
            self._world = None

    @property
    def _there(self) -> Stepped:
        if self._world is None:
            raise ValueError("reset comes first")
        return self._world

    def _observed(self) -> dict[str, np.ndarray]:
        state, environment = self._there.observed()
        return {
            "agent_pos": state.astype(np.float32),
            "environment_state": environment.astype(np.float32),
        }


def _numbers(size: int) -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
