"""The option --mapping, of every verb that reads a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

AUTO = Path("auto")
"""The mapping that is found in the recording itself."""


def add_mapping(parser: argparse.ArgumentParser) -> None:
    """Add --mapping to the options of a verb.

    Parameters
    ----------
    parser
        Of the verb.
    """
    text = (
        "names topics, columns, axes, units (config/recordings/example.yaml); auto: is found in"
        " the recording and written to a file"
    )
    parser.add_argument("--mapping", metavar="FILE", type=Path, help=text)


def settle_mapping(options: argparse.Namespace, source: Path, name: str) -> None:
    """Put the file of a mapping in the place of `auto` among the options; None where the recording
    reads right without one.

    Parameters
    ----------
    options
        Of the verb.
    source
        The bag.
    name
        That the file begins with.

    Raises
    ------
    ValueError
        If there is such a file, or if no mapping mends the recording.
    """
    if options.mapping != AUTO:
        return
    from dart_skill.common.files import new_file
    from dart_skill.recording.imports import mapping_text
    from dart_skill.session import auto_mapping

    mapping, found = auto_mapping(source)
    options.mapping = None
    if found is None and mapping.is_own:
        return
    path = Path(f"{name}_mapping.yaml")
    if path.exists():
        raise ValueError(f"{path} exists already: give it with --mapping, or move it away")
    about = f"# {source.name}: {found}\n" if found else ""
    with new_file(path) as file:
        file.write((about + mapping_text(mapping)).encode())
    if not options.json:
        print("\n".join([*([f"{found}"] if found else []), f"mapping: {path}"]))
    options.mapping = path
