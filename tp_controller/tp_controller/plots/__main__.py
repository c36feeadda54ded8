"""``python -m tp_controller.plots`` does what the command ``plot`` does."""

import sys

from tp_controller.plots.command import main

if __name__ == '__main__':
    sys.exit(main())
