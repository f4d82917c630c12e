"""`python3 -m dart_skill`: the command line."""

import sys

from dart_skill.cli import main

sys.exit(main())
