"""Dynamic movement primitives (thesis 7.2, 7.3, equations (7.6)-(7.13)): a spring-damper that is
pulled to a goal, and a learned forcing term, a function of a phase. Discrete movements have a
point attractor, rhythmic ones a limit cycle.

With tau = 1 / duration (or period), progress s and s' = tau, (7.8) and (7.9) are
    d2x/ds2 = K (g - x) - D dx/ds + A f(z),   K = alpha_x beta_x,  D = alpha_x = 2 sqrt(K),  x' =
    tau dx/ds.
(7.6) is z = exp(-alpha_z s), or the angle z = 2 pi s. The forcing term f is (7.10), (7.11). All of
these are functions of s alone. So the pace of s does not change the path.

The default differs from the printed equations in some points. Options give the printed form.

* The goal g moves. With a fixed g the pull jumps at the start. In the first formulation f was
  multiplied by goal - start instead. Then f vanishes for a movement that returns to its start, and
  it becomes too large for a far goal if the movement was learned with the goal near the start.
  Here g begins at the start: it is the attractor (7.20) of a smooth path from start to goal
  (Hoffmann, Park, Pastor and Schaal, "Biologically-inspired dynamical systems for movement
  generation", ICRA 2009). The system is linear, so a new start or goal adds the path between old
  and new, and the goal is reached at the end. `goal_path="fixed"` is (7.8).
* All weights are found in one regression. (7.13) fits each kernel as if it were alone, although
  kernels overlap, and this smooths the movement too much. `regression="local"` is (7.13). Both fit
  accelerations; `regression="path"` fits the positions of the movement, in which it is linear,
  too.
* (7.10) has no factor z, so f never ends; (7.13) has z. Without z, f fades to zero over a quarter
  of the duration after the end. `phase_scaled=True` multiplies f by z.
* In (7.13) Psi also contains the weights of samples and demonstrations. The amplitude A of (7.12)
  is one.
* Kernels of rhythmic primitives are periodic, so that the cycle is smooth at its end. The thesis
  gives no such kernels.
* A goal, amplitude or pace that changes during a movement is followed with the time constant of
  the spring. So a new goal does not make the acceleration jump, and a new duration not the
  velocity, as in (7.8) and (7.9).
* A tracking error slows down the whole movement and not the phase alone, so the movement stays on
  its path while it waits (the adaptive tau of Ijspeert, Nakanishi, Hoffmann, Pastor and Schaal,
  "Dynamical movement primitives", Neural Computation 25, 2013).
"""

from dart_skill.movement._discrete_primitive import DiscretePrimitive
from dart_skill.movement._primitive import Execution, PrimitiveState, Trajectory
from dart_skill.movement._rhythmic_primitive import RhythmicPrimitive

__all__ = ["DiscretePrimitive", "Execution", "PrimitiveState", "RhythmicPrimitive", "Trajectory"]
