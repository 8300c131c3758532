"""How fine a mesh must be: the same as `hybrid-rt accuracy`."""

import argparse
import sys

from hybrid_rt.cli.accuracy import DESCRIPTION, EXAMPLES, add_options, run
from hybrid_rt.cli.command import run_tool


def main() -> None:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=f"{__doc__}\n{DESCRIPTION}",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_options(parser)
    run(parser.parse_args())


if __name__ == "__main__":
    sys.exit(run_tool(main))
