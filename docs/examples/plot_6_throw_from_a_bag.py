"""
Learn to throw from a bag, and throw
====================================

A recording of five guided throws teaches the arm. It comes with the library. Then the arm throws in
the simulated world, at a basket that nobody demonstrated. Everything runs in this process, without
ROS.
"""

import matplotlib.pyplot as plt
import numpy as np

from dart_skill.figures import RIM_RADIUS
from dart_skill.recording import example_bag
from dart_skill.session import Session, learn_from_bag

# %%
# From the bag to a plan
# ----------------------
# The throws are cut out of the recording, and
# learned. The plan knows where the ball will come down.

skill, report = learn_from_bag(example_bag())
print(f"learned from {len(report.learned_from)} throws")

basket = np.array([1.9, 0.7, 0.4])  # centre of the rim [m]
plan = skill.plan(basket)
print(
    f"releases after {plan.release:.2f} s; comes down"
    f" {1e3 * np.linalg.norm(plan.thrown.landing - basket):.1f} mm from the middle"
)

# %%
# The throw
# ---------
# The simulated arm has friction, motor limits and a hand that opens late.
# Cameras judge where the ball came down.

session = Session(seed=1)
trial = session.throw(plan)
session.close()
miss = np.linalg.norm(trial.outcome.landing[:2] - basket[:2])
print(f"in the basket: {trial.outcome.in_basket}, {1e2 * miss:.1f} cm from its middle")

# %%

figure, axes = plt.subplots(figsize=(6.4, 4.8), layout="constrained")
for one in report.learned_from:
    axes.plot(*one.target[:2], "o", color="0.7")
axes.plot(*plan.path.position[:, :2].T, color="tab:blue", label="path of the hand")
axes.add_patch(plt.Circle(basket[:2], RIM_RADIUS, fill=False, color="tab:orange"))
axes.plot(*trial.outcome.landing[:2], "x", color="tab:red", label="where the ball came down")
axes.set(
    xlabel="x [m]",
    ylabel="y [m]",
    aspect="equal",
    title="from above; grey: baskets of the demonstrations",
)
axes.legend()
plt.show()

assert trial.outcome.in_basket
