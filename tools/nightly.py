"""Run what the ordinary suite leaves out, and note in docs/nightly.md when, and with what result.

Parts: the tests that are marked `nightly`, and the catalogue of hard cases. Without --only both are
run, in half an hour on two cores. The exit code is 0 only if every part that was run holds.
"""

import argparse
import datetime
import subprocess
import sys
import time
from pathlib import Path

from hybrid_rt.cli.command import run_tool
from meshing.outputs import replacing

ROOT = Path(__file__).parents[1]
PARTS = {
    "tests": ["-m", "pytest", "-q", "-m", "nightly", "-n", "2", "--dist", "loadfile"],
    "stability": ["tools/stability.py", "--out", "stability"],
}
HEAD = """# Nightly runs

What takes too long for every change is run by `python tools/nightly.py`, which writes this page.

| part | command | last run | commit | minutes | result |
| --- | --- | --- | --- | --- | --- |
"""


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=PARTS, help="one part")
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "nightly.md")
    args = parser.parse_args()
    rows, is_right = read_rows(args.page), True
    for part in [args.only] if args.only else PARTS:
        rows[part], holds = run_part(part)
        is_right &= holds
        with replacing(args.page) as file:
            file.write((HEAD + "\n".join(rows[name] for name in PARTS) + "\n").encode())
    return 0 if is_right else 1


def read_rows(page: Path) -> dict[str, str]:
    """Return the rows of the page by their part; of a part that never ran, one that says so."""
    rows = {name: f"| {name} | {_command(name)} | never | | | |" for name in PARTS}
    for line in page.read_text(encoding="utf-8").splitlines() if page.exists() else ():
        name = line.split("|")[1].strip() if line.startswith("| ") else ""
        if name in PARTS:
            rows[name] = line
    return rows


def run_part(part: str) -> tuple[str, bool]:
    """Run a part; return its row, and whether it holds."""
    began, now = time.monotonic(), datetime.datetime.now(datetime.UTC)
    git = ["git", "describe", "--always", "--dirty"]
    commit = subprocess.run(git, cwd=ROOT, capture_output=True, text=True, check=False).stdout
    last, lines = "nothing printed", []
    with subprocess.Popen(
        [sys.executable, *PARTS[part]], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            lines.append(line.strip())
    # Both parts sum up in their last line.
    last = next((line for line in reversed(lines) if line), last).strip("= ")
    verdict = "holds" if process.returncode == 0 else f"**fails** (exit code {process.returncode})"
    minutes = (time.monotonic() - began) / 60.0
    cells = [part, _command(part), f"{now:%Y-%m-%d %H:%M} UTC", commit.strip(), f"{minutes:.0f}",
             f"{verdict}: {last.replace('|', '/')}"]  # fmt: skip
    return f"| {' | '.join(cells)} |", process.returncode == 0


def _command(part: str) -> str:
    return f"`python {' '.join(PARTS[part])}`"


if __name__ == "__main__":
    sys.exit(run_tool(main))
