"""What the arm under joint_trajectory_controller and its tests agree on."""

import numpy as np

START = np.array([0.0, -0.90, 0.0, -0.75, 0.0, -0.35, 0.0])
ACTION = "/joint_trajectory_controller/follow_joint_trajectory"
