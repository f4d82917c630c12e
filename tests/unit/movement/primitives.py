"""How tests of movement primitives execute them and measure what comes of it."""

import numpy as np


def execute(primitive, state, seconds, dt=0.01, **settings):
    """States after each step, the first one being that before."""
    states = [state]
    for _ in range(round(seconds / dt)):
        states.append(primitive.step(states[-1], dt, **settings))
    return states


def track(states, name="position"):
    """One field of all states (n, ...)."""
    return np.array([getattr(state, name) for state in states])


def rms(values):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
