"""`python -m sitl` is the `sitl` command."""

import sys

from sitl.start import main

sys.exit(main())
