"""Imported by the process that makes workers, and by no other: they are deaf to Ctrl-C from their first instruction on.

Whoever asked for them ends them. One that heard it while it starts would say so with a traceback.
"""

import signal

signal.signal(signal.SIGINT, signal.SIG_IGN)
