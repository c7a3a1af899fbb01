"""``python -m jaxidl``: the command line."""

import sys

from jaxidl.cli import main

sys.exit(main())
