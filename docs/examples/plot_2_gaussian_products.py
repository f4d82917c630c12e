"""
Two points of view agree: products of Gaussians
===============================================

Each task frame brings a Gaussian of its own. Their product (3.8) is where both of them agree: the
more certain one wins, in each direction by itself. So task frames are combined for a new situation
(7.21).
"""

import matplotlib.pyplot as plt
import numpy as np

from dart_skill.figures import gaussian_ellipse
from dart_skill.mixture import Gaussian, product

# %%
# A frame knows x well and y poorly, another one the other way round
# -------------------------------------------------------------------

knows_x = Gaussian([0.0, 0.6], [[0.02, 0.0], [0.0, 0.5]])
knows_y = Gaussian([0.8, 0.0], [[0.4, 0.1], [0.1, 0.05]])
both, log_constant = product([knows_x, knows_y])
print("mean", both.mean.round(3), "deviations", np.sqrt(np.diag(both.covariance)).round(3))

# %%
# By hand: precisions add up, and means are weighted with them.

precisions = [np.linalg.inv(one.covariance) for one in (knows_x, knows_y)]
covariance = np.linalg.inv(sum(precisions))
mean = covariance @ sum(
    p @ one.mean for p, one in zip(precisions, (knows_x, knows_y), strict=True)
)
assert np.allclose(both.mean, mean) and np.allclose(both.covariance, covariance)

# %%
# One frame turns
# ---------------
# When the second frame is turned and moved, its Gaussian goes with it, and the product follows.

figure, panels = plt.subplots(
    1, 3, figsize=(10.0, 3.6), sharex=True, sharey=True, layout="constrained"
)
for axes, degrees in zip(panels, (0, 45, 90), strict=True):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turned = knows_y.linear_map([[c, -s], [s, c]], [0.3 * s, 0.3 * s])
    agreed, _ = product([knows_x, turned])
    for one, colour in ((knows_x, "tab:blue"), (turned, "tab:orange"), (agreed, "tab:green")):
        axes.add_patch(
            gaussian_ellipse(one.mean, one.covariance, 1.0, facecolor=colour, alpha=0.35)
        )
        axes.plot(*one.mean, "o", color=colour)
    axes.set(
        title=f"turned by {degrees} degrees",
        xlabel="x",
        xlim=(-1, 2),
        ylim=(-1, 2),
        aspect="equal",
    )
panels[0].set_ylabel("y")
plt.show()
