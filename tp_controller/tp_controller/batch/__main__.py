"""The command ``batch`` as ``python -m tp_controller.batch``."""

import sys

from tp_controller.batch.command import main

if __name__ == '__main__':
    sys.exit(main())
