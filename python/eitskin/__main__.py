"""``python -m eitskin``: run the command line."""

import sys

from eitskin.cli.main import main

sys.exit(main())
