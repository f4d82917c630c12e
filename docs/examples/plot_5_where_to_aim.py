"""
Darts: where to aim with how much precision
===========================================

A dart lands about its aim with a spread, the standard deviation sigma. For each spread there is a
best aim (thesis chapter 6). It moves as the thrower gets better, and it jumps once.
"""

import matplotlib.pyplot as plt
import numpy as np

from dart_skill.darts import Spread, best_aim, heat_map, optimum_path
from dart_skill.figures import draw_board, quantity_colours

# %%
# The expected score of each aim
# ------------------------------
# It is the board, blurred by the spread.

figure, panels = plt.subplots(1, 3, figsize=(11.0, 4.0), layout="constrained")
for axes, sigma in zip(panels, (8.0, 25.0, 60.0), strict=True):
    heat, best = heat_map(Spread(np.eye(2) * sigma**2), 2.0), best_aim(sigma)
    edges = heat.x[0], heat.x[-1], heat.y[0], heat.y[-1]
    axes.imshow(heat.expected_score, origin="lower", extent=edges, cmap=quantity_colours())
    draw_board(axes, "#FFFFFF60")
    axes.plot(*best.point, "P", color="red", markeredgecolor="white", markersize=10)
    axes.set_title(f"sigma {sigma:g} mm: {best.bed}, {best.expected_score:.1f} points")
plt.show()

# %%
# The best aim from 8 to 30 mm
# ----------------------------

path = optimum_path(8.0, 30.0)
[jump] = path.jumps
print(
    f"from {jump.below.bed} to {jump.above.bed} at sigma {jump.sigma:.2f} mm, where both score"
    f" {jump.below.expected_score:.2f}"
)

figure, axes = plt.subplots(figsize=(5.6, 5.2), layout="constrained")
draw_board(axes)
shown = axes.scatter(*path.aims.T, c=path.sigmas, cmap=quantity_colours(), s=14, zorder=3)
figure.colorbar(shown, label="sigma [mm]", shrink=0.8)
plt.show()

assert (jump.below.bed, jump.above.bed) == ("T20", "T19") and abs(jump.sigma - 16.907) < 0.01
