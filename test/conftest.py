# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""For all tests: what they start meets SIGINT as in the foreground."""

import signal

# a shell's background job, as a test run may be, ignores it, and so does what that starts
signal.signal(signal.SIGINT, signal.default_int_handler)
