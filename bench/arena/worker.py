#!/usr/bin/env python3
"""One solver of others on one file, in a process of its own: worker.py NAME PATH LAW SETTING SECONDS FOLDER OUT."""

import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import answer_file  # noqa: E402
import others  # noqa: E402


def main():
    name, path, law, setting, seconds, folder, out = sys.argv[1:]
    entrant = next(one for one in others.entrants() if one.name == name)
    entrant.load()
    answer_file.write(out, entrant.answer(path, law, float(setting), float(seconds), folder))


if __name__ == "__main__":
    main()
