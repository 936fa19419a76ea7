"""``python -m ipm_rs`` is the command ``ipm-rs``."""

import sys

from ipm_rs.cli import main

if __name__ == "__main__":
    sys.exit(main())
