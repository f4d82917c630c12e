"""The imports of a module without the syntax tree of all of it: to parse all modules takes
seconds, and several tests do.
"""

import ast
import re

IMPORT = re.compile(r"^ *(?:import [^\n]+|from [\w.]+ import (?:\([^)]*\)|[^\n]+))", re.MULTILINE)
"""A statement begins its line, and a line has one of them: ruff sees to it (E401, E701, E702)."""
LONG_TEXT = re.compile(r'""".*?"""', re.DOTALL)
"""A docstring, whose examples import, too."""


def imports(source: str) -> ast.Module:
    """The syntax tree of all imports of a module, in functions too, and of nothing else."""
    if source.count('"""') % 2:
        return ast.parse(source)
    lines = [statement.strip() for statement in IMPORT.findall(LONG_TEXT.sub("", source))]
    return ast.parse("\n".join(lines))
