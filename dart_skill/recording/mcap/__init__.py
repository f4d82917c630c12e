"""The container: MCAP files read whole, walked when damaged, and written so that a crash costs
little.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
