"""Makes the figures under docs/figures; see toolchain/figures.sh."""

import filecmp
import glob
import os
import signal
import sys

import diagrams
import pictures
import plots
import runs
import screens
from measured import measure

# Every figure: file, how it is made. The page that shows it names the file.
FIGURES = {
    "architecture.svg": diagrams.architecture,
    "threads.svg": diagrams.threads,
    "frames.svg": diagrams.frames,
    "window.svg": diagrams.window,
    "trajectory.svg": plots.trajectory,
    "error_over_time.svg": plots.error_over_time,
    "consistency.svg": plots.consistency,
    "accuracy.svg": plots.accuracy,
    "draws.svg": plots.draws,
    "full_smoothing_seeds.svg": plots.full_smoothing_seeds,
    "loop_closure.svg": plots.loop_closure,
    "loops_selected.svg": plots.loops_selected,
    "loop_selection.svg": plots.loop_selection,
    "latency.svg": plots.latency,
    "projected_uncertainty.svg": plots.projected_uncertainty,
    "tracks.jpg": pictures.tracks,
    "stereo_matches.jpg": pictures.stereo_matches,
    "mesh_over_image.jpg": pictures.mesh_over_image,
    "labelled_map.jpg": pictures.labelled_map,
    "distance_slice.jpg": pictures.distance_slice,
    "view.jpg": screens.view,
    "report.jpg": screens.report,
}


# A moment of a run in real time is another one each time.
NOT_REPEATED = ("view.jpg",)


def check():
    """Makes all figures anew; 1 when one differs from the committed one, is unknown here or on no page."""
    committed, out = os.path.join(runs.ROOT, "docs/figures"), os.path.join(runs.WORK, "check")
    os.makedirs(out, exist_ok=True)
    bad = sorted(set(os.listdir(committed)) - set(FIGURES))
    for name in bad:
        print(f"{name}: no figure of this script")
    pages = [os.path.join(runs.ROOT, "README.md")]
    pages += glob.glob(os.path.join(runs.ROOT, "docs/**/*.md"), recursive=True)
    text = "".join(open(page).read() for page in pages)
    for name in FIGURES:
        if f"figures/{name})" not in text:
            print(f"{name}: on no page")
            bad.append(name)
    for name, make in FIGURES.items():
        if name in NOT_REPEATED:
            continue
        make(os.path.join(out, name))
        old = os.path.join(committed, name)
        if not os.path.exists(old) or not filecmp.cmp(old, os.path.join(out, name), shallow=False):
            print(f"{name}: differs from {os.path.join(out, name)}")
            bad.append(name)
    print(f"figures: {len(FIGURES) - len(NOT_REPEATED)} made anew, {len(bad)} faults")
    return 1 if bad else 0


def main(arguments):
    if arguments == ["--list"]:
        print("\n".join(FIGURES))
        return 0
    if arguments == ["--check"]:
        return check()
    if arguments[:1] == ["--measure"]:
        measure(arguments[1:])
        return 0
    out = os.path.join(runs.ROOT, "docs/figures")
    if arguments[:1] == ["--out"]:
        out, arguments = os.path.abspath(arguments[1]), arguments[2:]
    os.makedirs(out, exist_ok=True)
    by_stem = {name.split(".")[0]: name for name in FIGURES}
    wanted = [by_stem.get(name.split(".")[0], name) for name in arguments] or list(FIGURES)
    for name in wanted:
        if name not in FIGURES:
            print(f"figures: none is named {name}; --list names them", file=sys.stderr)
            return 2
        path = os.path.join(out, name)
        FIGURES[name](path)
        print(f"{name}: {os.path.getsize(path) / 1000:.0f} kB", flush=True)
    return 0


if __name__ == "__main__":
    # An exception, so that programs that were started are ended too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    sys.exit(main(sys.argv[1:]))
