"""The environment `dart` of LeRobot, which imports this package because of its name and so
registers it.
"""

import gymnasium

from lerobot_env_dart.configuration_dart import TASKS, DartEnv

for task in TASKS:
    gymnasium.register(
        id=f"lerobot_env_dart/{task}",
        entry_point="lerobot_env_dart.world:DartWorld",
        kwargs={"task": task},
    )

__all__ = ["DartEnv"]
