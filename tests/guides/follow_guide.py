#!/usr/bin/env python3
"""Follows a page of docs/ literally, in an empty folder, as its reader would.

usage: follow_guide.py PAGE ROOT PROGRAM [--before COMMAND] [--short OLD NEW]...
  PAGE     the guide (Markdown)
  ROOT     the project's folder: its `build`, `tests` and `toolchain` are those of the guide's commands
  PROGRAM  what `swiftlet` is
  --before COMMAND   run before each block of commands (it connects the devices of a test), which GUIDE_COMMANDS holds
  --short OLD NEW    in commands: a time that a test does not have
  --interrupt-after SECONDS   when commands that run until Ctrl-C get it (5)

Fenced blocks, from the top of the page:
  sh    commands; all must end with 0, but for a line that ends with `# exit code N`, or
        `N or M`.
        `# until Ctrl-C` at its end: interrupted after some seconds, must end with 0 then.
  text  right after it: lines that it must have printed, in this order; `...` stands for anything.
  yaml, cpp, cmake, csv whose first line is a comment with a file's name: that file's contents.
  Other blocks are pictures.
Exit code: 0 when all went as the page says, 1 with the first difference.
"""

import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

FILES = ("yaml", "cpp", "cmake", "csv")


def blocks(text):
    for match in re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S):
        line = text.count("\n", 0, match.start()) + 1
        yield line, match.group(1), match.group(2)


def as_script(commands, short, interrupt_after):
    for old, new in short:
        commands = commands.replace(old, new)
    lines = []
    for line in commands.splitlines():
        expected = re.search(r"# exit code (\d+)(?: or (\d+))?$", line)
        if expected:
            code, other = expected.group(1), expected.group(2) or expected.group(1)
            line = f"code=0; {line[: expected.start()]} || code=$?; [ $code -eq {code} ] || [ $code -eq {other} ]"
        elif line.endswith("# until Ctrl-C"):
            line = f"timeout --preserve-status --signal=INT {interrupt_after} {line}"
        lines.append(line)
    return "\n".join(lines)


def first_missing(expected, printed):
    at = 0
    lines = printed.splitlines()
    for wanted in filter(None, map(str.strip, expected.splitlines())):
        pattern = ".*".join(re.escape(part) for part in re.split(r"\.\.\.|…", wanted))
        pattern = re.sub(r"(\\ )+", r"\\s+", pattern)
        while at < len(lines) and not re.search(pattern, lines[at]):
            at += 1
        if at == len(lines):
            return wanted
        at += 1
    return None


def follow(given, folder, environment):
    printed = None
    page = given.page
    for line, kind, body in blocks(page.read_text()):
        where = f"{page.name}:{line}"
        if kind == "sh":
            if given.before:
                subprocess.run(["sh", "-c", given.before], cwd=folder, env=dict(environment, GUIDE_COMMANDS=body),
                               check=True)
            script = as_script(body, given.short, given.interrupt_after)
            done = subprocess.run(["sh", "-eu", "-c", script], cwd=folder, env=environment,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            printed = done.stdout
            print(f"---- {where}\n{body}{printed}", flush=True)
            if done.returncode != 0:
                return f"{where}: ended with {done.returncode}"
        elif kind == "text" and printed is not None:
            missing = first_missing(body, printed)
            if missing:
                return f"{where}: was not printed: {missing}"
            printed = None
        elif kind in FILES:
            name = re.match(r"(?:#|//) ([\w./-]+\.\w+)$", body.splitlines()[0])
            if name:
                file = folder / name.group(1)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(body)
    return None if printed is not None or "```sh" in page.read_text() else f"{page.name}: no commands"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("page", type=pathlib.Path)
    parser.add_argument("root", type=pathlib.Path)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--before")
    parser.add_argument("--short", nargs=2, action="append", default=[])
    parser.add_argument("--interrupt-after", type=float, default=5)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for shown in ("build", "tests", "toolchain"):
            (folder / shown).symlink_to(given.root.resolve() / shown)
        environment = dict(os.environ, PATH=f"{given.program.resolve().parent}:{os.environ['PATH']}")
        fault = follow(given, folder, environment)
    if fault:
        sys.exit(f"follow_guide: {fault}")


if __name__ == "__main__":
    main()
