"""``python -m eitskin``: the command line."""

import sys

from eitskin.cli.main import main

sys.exit(main())
