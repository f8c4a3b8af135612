"""For all tests: SIGINT interrupts.

A shell that starts them in the background has them ignore it, and every process that they start would too.
"""

import signal

signal.signal(signal.SIGINT, signal.default_int_handler)
