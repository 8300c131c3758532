"""Judge part reports by OpenCASCADE, which shares neither code nor formula with them: parts of known answer, or files.

``python tools/verify_part.py [FOLDER] [--only WORD] [--seconds 60] [--samples 4000]``. Of each closed part: volume, area,
centre and inertia against `GProp`, to 1e-5; box against `BRepBndLib.AddOptimal`; area and radius of each face; draft
against normals of samples; sharp edges against those of the file. Of thickness along normals: chords of samples, and of
points beside edges, by line intersections, none below the proven bound, and the named chord is inside the solid, along a
normal, and as long. Of balls: those that shrink until no point of a dense cloud is inside; the named one's contacts are as
far from its centre as the whole solid is. Every claim that fails is printed, and makes the exit code 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from hybrid_rt.cad.process import SUFFIXES


def main() -> int:
    """Judge files, or parts of known answer."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "folder", type=Path, nargs="?", help="of CAD files; default: parts of known answer"
    )
    parser.add_argument("--only", default="", help="names with this")
    parser.add_argument("--seconds", type=float, default=60.0, help="for each search")
    parser.add_argument("--samples", type=int, default=4000)
    options = parser.parse_args()
    # Only here: the command explains itself without OpenCASCADE.
    from OCP.Message import Message

    from proof.cases.known_parts import KNOWN_PARTS
    from proof.part_judge import verify, written

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    n_false = 0
    if options.folder is not None:
        for file in sorted(f for f in options.folder.iterdir() if f.suffix.lower() in SUFFIXES):
            if options.only in file.name:
                n_false += verify(file, options.seconds, options.samples)
    else:
        with tempfile.TemporaryDirectory() as folder:
            for known in KNOWN_PARTS:
                if options.only in known.name:
                    file = written([known.make()], Path(folder) / "part.step")
                    n_false += verify(file, options.seconds, options.samples, known)
    print(f"{n_false} false claims")
    return int(n_false > 0)


if __name__ == "__main__":
    sys.exit(main())
