"""For all tests: SIGINT interrupts, and hypothesis draws the same examples every time.

A shell that starts them in the background has them ignore it, and every process that they start would too.
"""

import signal

from hypothesis import settings

signal.signal(signal.SIGINT, signal.default_int_handler)
settings.register_profile("reproducible", derandomize=True)
settings.load_profile("reproducible")
