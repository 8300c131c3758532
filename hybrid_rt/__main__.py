"""``python -m hybrid_rt`` is the command ``hybrid-rt``."""

import sys

from hybrid_rt.cli.program import main

sys.exit(main())
