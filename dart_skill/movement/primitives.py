"""Dynamic movement primitives: a spring-damper towards a goal, shaped by a learned function of a phase (thesis 7.2,
7.3, equations (7.6)-(7.13)); point attractors for discrete movements, limit cycles for rhythmic ones.

With tau = 1 / duration (or period), progress s and s' = tau, (7.8) and (7.9) are
    d2x/ds2 = K (g - x) - D dx/ds + A f(z),   K = alpha_x beta_x,  D = alpha_x = 2 sqrt(K),  x' = tau dx/ds,
(7.6) is z = exp(-alpha_z s), or the angle z = 2 pi s, and f is (7.10), (7.11). All of these are functions of s alone:
how fast s runs does not change the path.

Where the default is not what is printed, and how to get that:
* g moves. A fixed g jumps ahead, and multiplying f by goal - start instead, as the first formulation did, collapses a
  movement that returns to its start and blows up one learned near it. Following Hoffmann, Park, Pastor and Schaal,
  "Biologically-inspired dynamical systems for movement generation", ICRA 2009, g sets out from the start: it is the
  attractor (7.20) of a smooth path from start to goal. By linearity a new start or goal adds to the movement the path
  between old and new, and the goal is reached at the end of the duration. `goal_path="fixed"` is (7.8).
* All weights are found together, since kernels overlap and (7.13) fits each as if it were alone, which blurs the
  movement. `regression="local"` is (7.13).
* (7.10) has no z and never ends; (7.13) has z. Without z, f is released over a quarter of the duration after the end;
  `phase_scaled=True` multiplies it by z.
* In (7.13) Psi also has the weights of samples and demonstrations, and the amplitude A of (7.12) is one.
* Kernels of rhythmic primitives are periodic, so that the cycle has no seam; the thesis gives none.
* Goal, amplitude and pace that change during a movement are followed with the time constant of the spring, so that
  a new goal does not jump the acceleration, nor a new duration the velocity, as (7.8) and (7.9) would.
* A tracking error slows down the whole movement, not the phase alone (the adaptive tau of Ijspeert, Nakanishi, Hoffmann,
  Pastor and Schaal, "Dynamical movement primitives", Neural Computation 25, 2013): what waits keeps to its path.
"""

from dart_skill.movement._discrete_primitive import DiscretePrimitive
from dart_skill.movement._primitive import Execution, PrimitiveState, Trajectory
from dart_skill.movement._rhythmic_primitive import RhythmicPrimitive

__all__ = ["DiscretePrimitive", "Execution", "PrimitiveState", "RhythmicPrimitive", "Trajectory"]
