#!/usr/bin/env python3
"""Movement primitives against movement_primitives (its Cython steppers where they are built):
imitation of a demonstration of 7 joints and 1000 steps with 50 weights each, the open-loop
movement, and online steps.

    python3 -m benchmarks.primitives

One thread, medians of the processor time of interleaved repeats in the same process. The script
fails if our movement is not ten times as close to the demonstration as the peer's. The peer is
optional: pip install movement_primitives.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse  # noqa: E402
import statistics  # noqa: E402
import time  # noqa: E402

import numpy as np  # noqa: E402

from benchmarks.rows import tell  # noqa: E402
from dart_skill.movement import DiscretePrimitive  # noqa: E402

try:
    from movement_primitives.dmp import DMP
except ImportError:
    DMP = None

N_STEPS = 1000
"""Number of samples of a movement."""
N_JOINTS = 7
"""Number of joints."""
N_WEIGHTS = 50
"""Number of weights of each joint."""
DURATION = 1.0
"""Duration of a movement [s]."""
# Least ratios of time, and the largest ratio of the errors of reproduction.
TARGETS = {"imitate": 4.0, "open loop": 12.0, "1000 steps": 1.5}
ERROR_TARGET = 0.1


def demonstration(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (1000,) and joint angles (1000, 7): a minimum-jerk reach plus a sine of it, from rest
    to rest, since the peer cannot start in motion.
    """
    rng = np.random.default_rng(seed)
    stamps = np.linspace(0.0, DURATION, N_STEPS)
    s = stamps / DURATION
    reach = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    swing = np.sin(2.0 * np.pi * np.outer(reach, rng.integers(1, 4, N_JOINTS)))
    return stamps, np.outer(reach, rng.uniform(-1.0, 1.0, N_JOINTS)) + swing * rng.uniform(
        0.1, 0.2, N_JOINTS
    )


def medians(tasks: dict, repeats: int) -> dict:
    """Median processor seconds per task, the tasks taking turns so that a disturbance meets all of
    them.
    """
    seconds = {name: [] for name in tasks}
    for repeat in range(repeats + 2):
        for name, task in tasks.items():
            begin = time.process_time()
            task()
            if repeat >= 2:
                seconds[name].append(time.process_time() - begin)
    return {name: statistics.median(values) for name, values in seconds.items()}


def rmse(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(one - other))))


def own_tasks(stamps: np.ndarray, joints: np.ndarray) -> tuple[dict, dict]:
    primitive = DiscretePrimitive(N_WEIGHTS).fit(stamps, joints)

    def online():
        state = primitive.begin()
        for _ in range(N_STEPS - 1):
            state = primitive.step(state, stamps[1])

    tasks = {
        "imitate": lambda: DiscretePrimitive(N_WEIGHTS).fit(stamps, joints),
        "open loop": lambda: primitive.open_loop(stamps),
        "1000 steps": online,
    }
    return tasks, {"runge-kutta": rmse(primitive.open_loop(stamps).position, joints)}


def peer_tasks(stamps: np.ndarray, joints: np.ndarray) -> tuple[dict, dict]:
    step = stamps[1]

    def learn():
        # Its Euler stepper subdivides by int_dt; a hair more than one step keeps it from doing so.
        peer = DMP(
            n_dims=N_JOINTS,
            execution_time=DURATION,
            dt=step,
            int_dt=step * (1.0 + 1e-6),
            n_weights_per_dim=N_WEIGHTS,
        )
        peer.imitate(stamps, joints)
        return peer

    peer, tasks, errors = learn(), {"imitate": learn}, {}
    for stepper in ("euler-cython", "rk4-cython", "euler", "rk4"):
        try:
            _, path = peer.open_loop(step_function=stepper)
        except ValueError:
            print(
                f"movement_primitives has no stepper {stepper} here: it was built without Cython"
            )
            continue
        errors[stepper] = rmse(path[:N_STEPS], joints)
        tasks[f"open loop {stepper}"] = lambda stepper=stepper: peer.open_loop(
            step_function=stepper
        )
    tasks["1000 steps"] = lambda: _peer_online(peer, joints)
    return tasks, errors


def _peer_online(peer, joints: np.ndarray) -> None:
    peer.reset()
    position, velocity = joints[0].copy(), np.zeros(N_JOINTS)
    for _ in range(N_STEPS):
        position, velocity = peer.step(position, velocity)


def report(own: dict, own_errors: dict, peer: dict, peer_errors: dict) -> None:
    print(f"{'work':<28}{'dart_skill':>12}{'peer':>12}{'ratio':>9}   asked")
    for name, seconds in own.items():
        print(f"{name:<28}{1e3 * seconds:>9.2f} ms", end="" if peer else "\n")
        for index, other in enumerate(key for key in peer if key.startswith(name)):
            label = (
                ""
                if index == 0 and other == name
                else f"\n  peer: {other[len(name) :].strip():<20}" + " " * 12
            )
            missed = "" if peer[other] / seconds >= TARGETS[name] else ", missed"
            target = f"   {TARGETS[name]:g}{missed}"
            print(
                f"{label}{1e3 * peer[other]:>9.2f} ms{peer[other] / seconds:>9.1f}{target}", end=""
            )
            beside, ratio = (
                f"movement_primitives {other[len(name) :].strip()} {1e3 * peer[other]:.2f} ms",
                peer[other] / seconds,
            )
            tell(
                f"movement primitive, {name}",
                f"{1e3 * seconds:.2f} ms",
                beside,
                ratio,
                f"{TARGETS[name]:g}",
                ratio >= TARGETS[name],
            )
        print(end="\n" if peer else "")
    error = own_errors["runge-kutta"]
    print(f"{'rmse to the demonstration':<28}{error:>12.2e}", end="\n")
    for stepper, other in peer_errors.items():
        print(
            f"  peer: {stepper:<32}{other:>12.2e}{error / other:>9.4f}   {ERROR_TARGET:g} at most"
        )
        if not error < ERROR_TARGET * other:
            raise SystemExit(
                "the comparison is void: our movement must be as close to the demonstration"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=20, help="repeats per task (default 20)")
    options = parser.parse_args()
    stamps, joints = demonstration()
    print(
        f"{N_STEPS} steps, {N_JOINTS} joints, {N_WEIGHTS} weights; one thread; median of"
        f" {options.repeats} repeats; numpy {np.__version__}"
    )
    tasks, errors = own_tasks(stamps, joints)
    peer, peer_errors = {}, {}
    if DMP is None:
        print(
            "skipped the comparison: movement_primitives is not installed (pip install"
            " movement_primitives)"
        )
    else:
        peer, peer_errors = peer_tasks(stamps, joints)
    seconds = medians(
        {("own", k): v for k, v in tasks.items()} | {("peer", k): v for k, v in peer.items()},
        options.repeats,
    )
    own_seconds, peer_seconds = (
        {k: v for (who, k), v in seconds.items() if who == side} for side in ("own", "peer")
    )
    report(own_seconds, errors, peer_seconds, peer_errors)


if __name__ == "__main__":
    main()
