"""Runs a scene in a process of its own, which kills itself at a given moment.

``python killed_run.py SCENE FOLDER MOMENT``: a moment is a file of the results being opened,
renamed or removed, counted from 1. With 0 the run goes to its end and prints how many there were.
"""

import os
import signal
import sys

EVENTS = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "shutil.rmtree"}


def main(scene: str, folder: str, moment: int) -> None:
    count = 0

    def look(event: str, arguments: tuple) -> None:
        nonlocal count
        if event in EVENTS and str(arguments[0]).startswith(folder):
            count += 1
            if count == moment:
                os.kill(os.getpid(), signal.SIGKILL)

    from lcmchain.pipeline import run
    from lcmchain.report import style
    from lcmchain.scene import read_scene

    style.DPI = 60  # as the tests draw

    sys.addaudithook(look)
    run(read_scene(scene), folder)
    print(count)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
