"""Settings of the environment `dart`, which lerobot registers."""

from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_STATE

TASKS = ("place", "throw")
SIZES = {"agent_pos": 22, "environment_state": 16, ACTION: 8}
"""Numbers of joints and hand, of the two bodies of a task, and of an action."""


@EnvConfig.register_subclass("dart")
@dataclass
class DartEnv(EnvConfig):
    """Settings of `DartWorld`.

    Parameters
    ----------
    task
        "place" (default) or "throw".
    fps
        Actions per second, as the dataset has frames.
    episode_length
        Most actions of an episode.
    wide
        Whether situations are drawn as the skill is tried, and not as it is shown.
    """

    task: str | None = "place"
    fps: int = 100
    episode_length: int = 1200
    wide: bool = False
    features: dict[str, PolicyFeature] = field(
        default_factory=lambda: {
            "agent_pos": PolicyFeature(FeatureType.STATE, (SIZES["agent_pos"],)),
            "environment_state": PolicyFeature(FeatureType.ENV, (SIZES["environment_state"],)),
            ACTION: PolicyFeature(FeatureType.ACTION, (SIZES[ACTION],)),
        }
    )
    features_map: dict[str, str] = field(
        default_factory=lambda: {
            "agent_pos": OBS_STATE,
            "environment_state": OBS_ENV_STATE,
            ACTION: ACTION,
        }
    )

    def __post_init__(self) -> None:
        if self.task not in TASKS:
            raise ValueError(f"task is '{self.task}': give {' or '.join(TASKS)}")

    @property
    def package_name(self) -> str:
        return "lerobot_env_dart"

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        return {"fps": self.fps, "episode_length": self.episode_length, "wide": self.wide}
