"""`dart-skill experiment faults`: what the real graph does when things go wrong. The nodes run it
(`graph_verbs`).
"""

from __future__ import annotations

import argparse

from dart_skill.cli import graph_verbs


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `faults` to the experiments of `dart-skill experiment`."""
    graph_verbs.add_to(experiments, "faults")
