"""
The mixture against that of scikit-learn
========================================

Both fit Gaussian mixtures by EM. From the same start they find the same mixture. The one of this
package takes weights of the samples, too, and answers what robots ask: regression, products, maps
and conditions.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.mixture import GaussianMixture as TheirMixture

from dart_skill.figures import gaussian_ellipse
from dart_skill.mixture import GaussianMixture, regress

rng = np.random.default_rng(3)
x = rng.uniform(0.0, 1.0, 500)
samples = np.column_stack([x, np.sin(6.0 * x) + rng.normal(0.0, 0.08, 500)])

# %%
# The same start, the same end
# ----------------------------

start = GaussianMixture(4).fit(samples, rng=np.random.default_rng(0))
crude = GaussianMixture.from_parameters(
    np.full(4, 0.25), start.means_ + 0.05, np.array([np.eye(2) * 0.05] * 4)
)
ours = GaussianMixture(4, tolerance=1e-12, max_iterations=5000, covariance_floor=1e-9).fit(
    samples, start=crude
)
theirs = TheirMixture(
    4, tol=1e-12, max_iter=5000, reg_covar=1e-12, weights_init=crude.priors_, means_init=crude.means_,
    precisions_init=np.linalg.inv(crude.covariances_),
).fit(samples)  # fmt: skip
off = (
    np.abs(ours.means_ - theirs.means_).max(),
    abs(ours.log_density(samples).mean() - theirs.score(samples)),
)
print(f"means differ by {off[0]:.1e}, the mean log-likelihood by {off[1]:.1e}")
assert off[0] < 1e-4 and off[1] < 1e-8

# %%
# What theirs does not do
# -----------------------
# Weights: here the right half counts ten times.
# Regression: where is y for a given x, and how sure is that?

weighted = GaussianMixture(4).fit(
    samples, weights=np.where(x > 0.5, 10.0, 1.0), rng=np.random.default_rng(0)
)
asked = np.linspace(0.0, 1.0, 101)[:, None]
mean, covariance = regress(weighted, asked, [0], [1])
deviation = np.sqrt(covariance[:, 0, 0])

# %%

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), sharey=True, layout="constrained")
left.plot(*samples.T, ".", color="0.75", markersize=3)
for ours_mean, ours_covariance, theirs_mean, theirs_covariance in zip(
    ours.means_, ours.covariances_, theirs.means_, theirs.covariances_, strict=True
):
    left.add_patch(
        gaussian_ellipse(ours_mean, ours_covariance, 2.0, facecolor="tab:blue", alpha=0.3)
    )
    left.add_patch(
        gaussian_ellipse(
            theirs_mean, theirs_covariance, 2.0, fill=False, edgecolor="black", linestyle="--"
        )
    )
left.set(xlabel="x", ylabel="y", title="blue: this package; dashed: scikit-learn")
right.plot(*samples.T, ".", color="0.75", markersize=3)
right.fill_between(
    asked[:, 0],
    mean[:, 0] - 2 * deviation,
    mean[:, 0] + 2 * deviation,
    color="tab:green",
    alpha=0.25,
)
right.plot(asked[:, 0], mean[:, 0], color="tab:green")
right.set(xlabel="x", title="regression, with two standard deviations")
plt.show()
