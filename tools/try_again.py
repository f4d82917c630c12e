"""Tries the test files again in which something has failed: one after the other, on a machine that
does nothing else.

Real nodes over real DDS may be late on a machine that is busy with other tests. Whoever depends on
that passes here, and is named; whoever is wrong fails twice. More than a few files are no
accident, and are not tried again.

    python3 tools/try_again.py [OPTIONS OF PYTEST]
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FAILED = ROOT / ".pytest_cache" / "v" / "cache" / "lastfailed"
MOST = 6
"""Files."""


def failed_files(record: Path) -> list[str]:
    """The files in which tests failed in the run that left this record of pytest's; none where
    there is no record.
    """
    return (
        sorted({name.split("::")[0] for name in json.loads(record.read_text())})
        if record.is_file()
        else []
    )


def main(options: Sequence[str] = ()) -> int:
    """0 if all that failed passes now. options: of pytest, those of the run in which it failed."""
    files = failed_files(FAILED)
    if not 0 < len(files) <= MOST:
        print(f"{len(files)} files failed; only one to {MOST} are tried again", file=sys.stderr)
        return 1
    print(f"\nTRIED AGAIN, alone: {' '.join(files)}", flush=True)
    # A process that a signal ended has a negative status.
    failed = [
        file
        for file in files
        if subprocess.call([sys.executable, "-m", "pytest", *options, file], cwd=ROOT) != 0
    ]
    print(
        f"\nTRIED AGAIN, alone: {'failed' if failed else 'passed'}: {' '.join(failed or files)}",
        flush=True,
    )
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
