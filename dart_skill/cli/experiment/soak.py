"""`dart-skill experiment soak`: hours of practice on the real graph. The nodes run it
(`graph_verbs`).
"""

from __future__ import annotations

import argparse

from dart_skill.cli import graph_verbs


def add_to(experiments: argparse._SubParsersAction) -> None:
    """Add `soak` to the experiments of `dart-skill experiment`."""
    graph_verbs.add_to(experiments, "soak")
