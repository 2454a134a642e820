"""The command ``lcmchain``, and ``python -m lcmchain`` where its script is not on the path."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line; Ctrl-C while it is being loaded ends as it does later."""
    try:
        # Not at the top of the file: a signal there would show a traceback of imports.
        from lcmchain.cli import main as run_command
    except KeyboardInterrupt:
        print("Error: stopped by the user", file=sys.stderr)
        sys.exit(1)
    run_command()


if __name__ == "__main__":
    main()
