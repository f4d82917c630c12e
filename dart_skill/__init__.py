"""dart_skill: an arm learns a skill from a few demonstrations, gets better with practice and
learns where to aim.
"""

__version__ = "0.1.0"
