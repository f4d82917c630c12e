"""Bags in Rerun: finding it, a layout that fits the bag, the call, and the page for a browser."""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
