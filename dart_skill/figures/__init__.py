"""The figures of a run, as SVG and PNG: one module per figure.

The same data give the same bytes.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
