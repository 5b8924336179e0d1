"""`python -m sitl` is the `sitl` command."""

import sys

from sitl.entry import main

sys.exit(main())
