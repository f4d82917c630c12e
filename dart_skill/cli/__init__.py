"""The command line `dart-skill`. Each verb is one file with its options, its work and its output.

A verb's `add_to(commands)` adds its parser, and sets what runs it. Whatever takes long to import is imported when the verb runs, so that
help, usage errors and completion with TAB come at once.
"""

from dart_skill.cli._main import main

__all__ = ["main"]
