"""Where rcl writes the logs of nodes: it starts nothing where it cannot make its folder."""

import os
import tempfile
from pathlib import Path


def find_log_folder() -> None:
    """Choose a new folder for temporary files where the usual one cannot be: no HOME, or one that
    this user may not write to. Call before rclpy starts.
    """
    if os.environ.get("ROS_LOG_DIR"):
        return
    if not _is_writable(_usual()):
        os.environ["ROS_LOG_DIR"] = tempfile.mkdtemp(prefix="ros_log_")


def _usual() -> Path | None:
    """As rcl has it; it looks at HOME alone, not at the list of users."""
    if named := os.environ.get("ROS_HOME"):
        return Path(named, "log")
    home = os.environ.get("HOME")
    return Path(home, ".ros", "log") if home else None


def _is_writable(folder: Path | None) -> bool:
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return folder is not None and os.access(folder, os.W_OK)
