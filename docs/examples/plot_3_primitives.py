"""
Movement primitives, of positions and of poses
==============================================

A primitive (thesis 7.6 to 7.13) learns a movement from one demonstration. Its goal and its
duration may change at any step. The same for poses turns on the unit quaternions, so no angle can
be singular.
"""

import matplotlib.pyplot as plt
import numpy as np

from dart_skill.movement import DiscretePrimitive
from dart_skill.movement.pose import DiscretePosePrimitive, angles_between, exponential

time = np.linspace(0.0, 1.0, 101)  # [s]
share = time**3 * (10.0 - 15.0 * time + 6.0 * time**2)

# %%
# Positions: the goal moves while the movement goes on
# ----------------------------------------------------

path = np.outer(share, [0.4, 0.0]) + np.outer(np.sin(np.pi * share), [0.0, 0.15])
primitive = DiscretePrimitive(25).fit(time, path)

state, goal, made = primitive.begin(), np.array([0.4, 0.0]), []
for k in range(150):
    if k == 40:
        goal = np.array([0.45, 0.2])
    state = primitive.step(state, 0.01, goal=goal)
    made.append(state.position)
made = np.array(made)
print(f"ends {1e3 * np.linalg.norm(made[-1] - goal):.1f} mm from the new goal")
assert np.linalg.norm(made[-1] - goal) < 0.002

# %%
# Poses: half a turn and more
# ---------------------------
# A pose is a row x, y, z and a
# quaternion x, y, z, w. Here the hand turns by 200 degrees about x while it moves.

half = 0.5 * np.radians(200.0) * share
turn = np.column_stack([np.sin(half), 0.0 * half, 0.0 * half, np.cos(half)])
poses = np.column_stack([np.outer(share, [0.4, 0.0, 0.1]), turn])
wrist = DiscretePosePrimitive(40).fit(time, poses)

state, there, turned = wrist.begin(), exponential(poses[-1], [0.1, 0.0, 0.1, 0.3, 0.0, 0.5]), []
for _ in range(180):
    state = wrist.step(state, 0.01, goal=there, duration=1.2)
    turned.append(np.degrees(angles_between(state.pose, poses[0])))
print(f"ends {np.degrees(angles_between(state.pose, there)):.2f} degrees from the new goal")
assert angles_between(state.pose, there) < 0.01

# %%

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
left.plot(*path.T, color="0.6", label="demonstration")
left.plot(*made.T, color="tab:blue", label="the goal moves after 0.4 s")
left.plot(*goal, "x", color="tab:red", label="new goal")
left.set(xlabel="x [m]", ylabel="y [m]", title="positions")
left.legend()
right.plot(time, np.degrees(angles_between(poses, poses[0])), color="0.6", label="demonstration")
right.plot(0.01 * np.arange(1, 181), turned, color="tab:blue", label="another goal, slower")
right.set(xlabel="time [s]", ylabel="turned against the start [degrees]", title="orientation")
right.legend()
plt.show()
