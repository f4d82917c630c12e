"""The throws of a bag as its sensors saw them. Whoever imports this needs neither SciPy nor matplotlib, so that it can begin at once."""

from __future__ import annotations

import os

from dart_skill.recording.imports import ThrowRecording, read_recording
from dart_skill.session import find_throws
from dart_skill.skill.observe import FoundThrow

Seen = tuple[ThrowRecording, list[FoundThrow]]
"""The raw streams, and the throws in them."""


def seen_throws(bag: str | os.PathLike) -> Seen:
    """The raw streams of a bag, and the throws that were found and judged in them; BagError says what is wrong with it."""
    recording = read_recording(bag)
    return recording, find_throws(recording)
