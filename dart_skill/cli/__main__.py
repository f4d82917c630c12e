"""`python3 -m dart_skill.cli`."""

import sys

from dart_skill.cli._main import main

sys.exit(main())
