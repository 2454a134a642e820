"""``python -m lcmchain``: the command, where its script is not on the path."""

from __future__ import annotations

from lcmchain.cli import main

if __name__ == "__main__":
    main()
