"""docs/reference.md says what the nodes say."""

import subprocess
import sys

from tests.paths import ROOT


def test_the_reference_is_what_the_nodes_say():
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "make_reference.py", "--check"],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
