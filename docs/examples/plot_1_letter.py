"""
A letter, written to where nobody wrote it
==========================================

Six demonstrations of one letter S, with noise, each of another size and at another place. DS-GMR
(thesis 7.18 to 7.21) encodes the attractor that would have pulled the pen, in two task frames: one
stands where the letter begins, the other where it ends. For a new letter it is retrieved from the
frames there and followed by a spring and a damper.
"""

import matplotlib.pyplot as plt
import numpy as np

from dart_skill.figures import BLUE, plot_frames, plot_mixture, plot_reproduction
from dart_skill.movement import DSGMR, TaskFrame

rng = np.random.default_rng(0)
time = np.arange(0.0, 1.5, 0.01)  # [s]

# %%
# What is shown
# -------------
# The pen moves from rest to rest. A demonstration is 150 positions [m], with noise of 0.5 mm.


def letter(start, end):
    """The path of the pen (150, 2) [m]."""
    s = time / time[-1]
    share = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    size = np.linalg.norm(end - start)
    bends = size * 0.5 * np.sin(2.0 * np.pi * share)
    across = np.array([[0.0, -1.0], [1.0, 0.0]]) @ (end - start) / size
    return start + np.outer(share, end - start) + np.outer(bends, across)


def frames(start, end):
    """Two points of view: world = A local + b. Time comes first, and passes through. Each is
    turned along the letter, and has its size.
    """
    along = end - start
    turned = np.column_stack([along, [-along[1], along[0]]])
    A = np.block([[np.eye(1), np.zeros((1, 2))], [np.zeros((2, 1)), turned]])
    return [TaskFrame(A, [0.0, *start]), TaskFrame(A, [0.0, *end])]


tasks = [(rng.uniform(-0.05, 0.05, 2), rng.uniform([0.15, -0.1], [0.3, 0.1])) for _ in range(6)]
shown = [letter(*task) + rng.normal(0.0, 0.0005, (len(time), 2)) for task in tasks]

# %%
# Learning, and a letter that nobody wrote
# ----------------------------------------

model = DSGMR(7, stiffness=400.0)
model.fit([model.encode(time, path) for path in shown], [frames(*task) for task in tasks])

new = np.array([0.1, 0.05]), np.array([-0.05, 0.35])
written = model.reproduce(frames(*new), time, position0=new[0], velocity0=np.zeros(2))
off = np.linalg.norm(written.position - letter(*new), axis=1)
print(
    f"at most {1e3 * off.max():.1f} mm beside the letter that was meant, {1e3 * off[-1]:.1f} mm at"
    " its end"
)

# %%
# The new letter goes up instead of to the right, and is larger than all that were shown.

figure, axes = plt.subplots(figsize=(7.0, 5.2), layout="constrained")
plot_mixture(axes, model.product(frames(*new)), dims=(1, 2), label="components (7.21)")
plot_frames(axes, frames(*new), size=0.15)
plot_reproduction(axes, written, demonstrations=shown)
axes.plot(*letter(*new).T, ":", color=BLUE, linewidth=2.0, label="meant")
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
figure.suptitle(str(model).replace(": ", "\n"))
figure.legend(loc="outside right center")
plt.show()

assert off.max() < 0.01 and off[-1] < 0.004
