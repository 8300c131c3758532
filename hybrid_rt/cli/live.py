"""The options of a live page, and its opening."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from hybrid_rt.cli.command import STOPPED

if TYPE_CHECKING:
    from hybrid_rt.analysis.picture_comparison import Picture
    from hybrid_rt.live.watch import LivePage
    from hybrid_rt.scene.scene import Scene


def add_live_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--live`` and ``--live-compare``."""
    parser.add_argument(
        "--live",
        type=parse_port,
        nargs="?",
        const=0,
        metavar="PORT",
        help="show the growing picture on a page of this machine (default: any free port); whoever "
        f"stops it there gets the passes done, and exit code {STOPPED}",
    )
    parser.add_argument(
        "--live-compare",
        type=Path,
        metavar="FILE",
        help="an earlier picture (.npz, .exr, .png) of the same size, to lay beside it on that page",
    )


def parse_port(text: str) -> int:
    """Read a port."""
    if not (text.isdecimal() and len(text) <= 5 and int(text) < 2**16):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no port: pass 0 (a free one) to 65535, or write --live after the scene"
        )
    return int(text)


@contextmanager
def open_page(name: str, options: argparse.Namespace) -> Iterator[LivePage | None]:
    """Open the page that is asked for, if any; say where it is; close it at the end.

    ``options.live_compare`` becomes a `Picture`.
    """
    if options.live is None:
        if options.live_compare is not None:
            raise ValueError("--live-compare: there is no page to show it on, pass --live as well")
        yield None
        return
    if options.live_compare is not None:
        from hybrid_rt.analysis.picture_comparison import load_picture

        options.live_compare = load_picture(options.live_compare)
    from hybrid_rt.live.watch import LivePage

    with LivePage(options.live, name) as page:
        if sys.stderr is not None:
            print(f"live page: {page.address}", file=sys.stderr, flush=True)  # noqa: T201
        yield page


def compare_on(page: LivePage | None, scene: Scene, picture: Picture | None) -> None:
    """Offer the page a picture to compare with; raise ValueError if it has another size."""
    if page is None or picture is None:
        return
    height, width, _ = picture.image.shape
    camera = scene.camera
    if (width, height) != (camera.width, camera.height):
        raise ValueError(
            f"--live-compare {picture.name} is {width} x {height}, the picture {camera.width} x "
            f"{camera.height}: pass one of the same size, or --width and --height"
        )
    page.compare_with(picture.name, picture.image)
