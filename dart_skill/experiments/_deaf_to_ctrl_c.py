"""Imported by the process that makes workers, and by no other: they are deaf to Ctrl-C from their
first instruction on.

The process that made them ends them. A worker that received Ctrl-C while it starts would print a
traceback.
"""

import signal

signal.signal(signal.SIGINT, signal.SIG_IGN)
