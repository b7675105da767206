"""``python -m atmoref`` is the command ``atmoref``."""

import sys

from atmoref.cli import main

if __name__ == "__main__":
    sys.exit(main())
