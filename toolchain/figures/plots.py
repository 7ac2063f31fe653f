"""Plots of runs and of committed tables, as SVG."""

import csv
import json
import os
import re

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

import runs
from style import BLACK, BLUE, GREEN, GREY, LIGHT, ORANGE, PINK, RED, SKY, panels, save_svg

DOCS = os.path.join(runs.ROOT, "docs")
MEASURED = os.path.join(os.path.dirname(__file__), "measured")


def seconds(trajectory, start=None):
    return (trajectory.stamps - (trajectory.stamps[0] if start is None else start)) * 1e-9


def distance_mm(estimate, true):
    return 1e3 * np.linalg.norm(estimate.p - true.p, axis=1)


def measured(name):
    with open(os.path.join(MEASURED, name)) as file:
        return list(csv.DictReader(file))


def table(page, first_header):
    """Rows of the Markdown table on a page of docs whose header begins so."""
    with open(os.path.join(DOCS, page)) as file:
        lines = file.read().splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith(f"| {first_header} |"))
    rows = []
    for line in lines[begin + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([re.sub("[`*]", "", cell).strip() for cell in line.strip("|").split("|")])
    return rows


# ---- trajectories ------------------------------------------------------------------------------------------------


def trajectory(path):
    estimate, true = runs.fitted(runs.tum(runs.default_run("vil_v102")), runs.truth(runs.log_folder("vil_v102")))
    figure, (above, height) = panels(1, 2, 3.9, width_ratios=[1, 1.25])
    above.plot(true.p[:, 0], true.p[:, 1], color=LIGHT, linewidth=5, label="truth")
    above.plot(estimate.p[:, 0], estimate.p[:, 1], color=BLUE, linewidth=1.2, label="odometry")
    above.plot(*true.p[0, :2], "o", color=BLACK, markersize=6)
    above.annotate("start", true.p[0, :2], xytext=(7, 5), textcoords="offset points")
    above.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="from above")
    above.legend(loc="best")
    height.plot(seconds(true), true.p[:, 2], color=LIGHT, linewidth=5)
    height.plot(seconds(estimate), estimate.p[:, 2], color=BLUE, linewidth=1.2)
    height.set(xlabel="time since the first image [s]", ylabel="z [m]", title="height")
    length = np.linalg.norm(np.diff(true.p, axis=0), axis=1).sum()
    figure.suptitle(f"vil_v102, two cameras: {1e3 * runs.ate(estimate, true):.1f} mm RMSE over {length:.0f} m")
    save_svg(figure, path)


def error_over_time(path):
    figure, axes = panels(3, 1, 6.0)
    for axis, log in zip(axes, runs.DRAWN_LOGS):
        run, true = runs.default_run(log), runs.truth(runs.log_folder(log))
        start = runs.tum(run).stamps[0]
        for name, color, label in (
            ("odometry.tum", BLUE, "odometry, as flown"),
            ("map.tum", ORANGE, "after full smoothing"),
        ):
            estimate, there = runs.fitted(runs.tum(run, name), true)
            axis.plot(seconds(estimate, start), distance_mm(estimate, there), color=color, label=label)
        axis.set(ylabel="position error [mm]", ylim=(0, None))
        axis.set_title(log, loc="left")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
    axes[-1].set_xlabel("time since the first image [s]")
    save_svg(figure, path)


def consistency(path):
    """Error of each axis with three of the estimate's own sigmas, in the gauge of the first keyframe."""
    run = runs.twin_without_loops()
    true = runs.truth(runs.twin_flight())
    s = runs.states(run)
    estimate = runs.Trajectory(
        s["timestamp"],
        np.stack([s[f"p_{k}"] for k in "xyz"], axis=1),
        runs.rotation(s["q_w"], s["q_x"], s["q_y"], s["q_z"]),
    )
    there, inside = runs.at_stamps(true, estimate.stamps)
    estimate = estimate.pick(inside)
    # Position and yaw are free: those of the first keyframe are made equal, and tilt stays an error.
    turn = estimate.R[0] @ there.R[0].T
    yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
    about_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    there = there.moved(about_z, estimate.p[0] - about_z @ there.p[0])
    position = 1e3 * (estimate.p - there.p)
    attitude = np.degrees(runs.rotation_vector(np.swapaxes(there.R, 1, 2) @ estimate.R))
    figure, axes = panels(3, 2, 5.6, sharex=True)
    inside_band = []
    for column, (error, variance, factor, unit) in enumerate(
        (
            (position, "var_p_", 1e3, "position {} [mm]"),
            (attitude, "var_phi_", np.degrees(1), "attitude about {} [deg]"),
        )
    ):
        for row, name in enumerate("xyz"):
            band = 3 * factor * np.sqrt(s[variance + name][inside])
            axis = axes[row, column]
            axis.fill_between(
                seconds(estimate), -band, band, color=SKY, alpha=0.35, linewidth=0, label="3 sigma of the estimate"
            )
            axis.plot(seconds(estimate), error[:, row], color=BLACK, linewidth=1.1, label="error")
            axis.set_ylabel(unit.format(name))
            inside_band.append(np.abs(error[1:, row]) <= band[1:])
    for axis in axes[-1]:
        axis.set_xlabel("time since the first image [s]")
    axes[0, 0].legend(loc="lower left", ncols=2, fontsize=9)
    figure.suptitle(f"twin_60, two cameras: {100 * np.mean(inside_band):.1f} % of the errors lie within 3 sigma")
    save_svg(figure, path)


def loop_closure(path):
    true = runs.truth(runs.twin_flight())
    runs_shown = (
        (runs.tum(runs.twin_without_loops()), GREY, "odometry, as flown"),
        (runs.tum(runs.twin_without_loops(), "map.tum"), ORANGE, "full smoothing, no loops"),
        (runs.tum(runs.twin(), "map.tum"), BLUE, "full smoothing with loops"),
    )
    start = runs_shown[0][0].stamps[0]
    magnified = 50
    figure, (above, error) = panels(2, 1, 6.4, height_ratios=[1.15, 1])
    for estimate, color, label in runs_shown:
        estimate, there = runs.fitted(estimate, true)
        if label != "odometry, as flown":
            drawn = there.p + magnified * (estimate.p - there.p)
            above.plot(drawn[:, 0], drawn[:, 1], color=color, linewidth=1.1)
        error.plot(
            seconds(estimate, start),
            distance_mm(estimate, there),
            color=color,
            label=f"{label}: {1e3 * runs.ate(estimate, there):.1f} mm RMSE",
        )
    above.plot(true.p[:, 0], true.p[:, 1], color=BLACK, linewidth=0.8, linestyle=":")
    above.set(
        aspect="equal",
        xlabel="x [m]",
        ylabel="y [m]",
        title=f"from above, errors drawn {magnified} times larger; dotted: truth",
    )
    error.set(xlabel="time since the first image [s]", ylabel="position error [mm]", ylim=(0, None))
    error.legend(loc="upper left", fontsize=9)
    error.set_ylim(0, 30)
    save_svg(figure, path)


def loops_selected(path):
    true = runs.truth(runs.twin_flight())
    found = runs.loops(runs.twin())
    figure, (above, time) = panels(1, 2, 4.0, width_ratios=[1.25, 1])
    above.plot(true.p[:, 0], true.p[:, 1], color=LIGHT, linewidth=2.5, label="trajectory")
    start = true.stamps[0]
    shown = set()
    rejected = [loop for loop in found if loop[2] != "selected"]
    selected = [loop for loop in found if loop[2] == "selected"]
    for loops, color, style, label in (
        (rejected, RED, "--", f"{len(rejected)} rejected"),
        (selected, BLUE, "-", f"{len(selected)} accepted"),
    ):
        for old, new, _ in loops:
            ends, _ = runs.at_stamps(true, [old, new])
            above.plot(
                ends.p[:, 0],
                ends.p[:, 1],
                color=color,
                linestyle=style,
                linewidth=0.9,
                label=None if label in shown else label,
                marker="o",
                markersize=2.5,
            )
            shown.add(label)
        time.plot(
            [(old - start) * 1e-9 for old, _, _ in loops],
            [(new - start) * 1e-9 for _, new, _ in loops],
            "o" if color == BLUE else "x",
            color=color,
            markersize=5,
            label=label,
        )
    above.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="two rooms that look the same, from above")
    above.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=3, fontsize=9)
    time.set(
        xlabel="time of the older keyframe [s]", ylabel="time of the newer keyframe [s]", title="each verified loop"
    )
    time.legend(loc="best", fontsize=9)
    save_svg(figure, path)


def projected_uncertainty(path):
    """The cells of the drawing on the page of `calibrate cameras`, with a scale of their own."""
    with open(os.path.join(runs.calibrated(), "report.html")) as file:
        document = re.search(r'id="report-document">(.*?)</script>', file.read(), re.S).group(1)
    drawings = {plot["id"]: plot["svg"] for plot in json.loads(document)["runs"][0]["plots"] if "svg" in plot}
    cell = re.compile(
        r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)" fill="[^"]*"><title>([\d.e-]+) px'
    )
    figure, axes = panels(1, 2, 3.2)
    cells = [[[float(v) for v in found] for found in cell.findall(drawings[f"uncertainty{c}"])] for c in (0, 1)]
    norm = Normalize(0, 1e3 * max(value for of_camera in cells for *_, value in of_camera))
    colors = colormaps["viridis"]
    for camera, axis in enumerate(axes):
        for x, y, width, height, value in cells[camera]:
            axis.add_patch(Rectangle((x, y), width, height, color=colors(norm(1e3 * value)), linewidth=0))
        axis.set(xlim=(0, 752), ylim=(480, 0), aspect="equal", xlabel="u [px]", title=f"camera {camera}")
        axis.grid(False)
    axes[0].set_ylabel("v [px]")
    bar = figure.colorbar(ScalarMappable(norm, colors), ax=axes, shrink=0.75, pad=0.01)
    bar.set_label("1 sigma [0.001 px]")
    figure.suptitle("uncertainty of a projected pixel after a rendered session of 30 s")
    save_svg(figure, path)


# ---- tables ------------------------------------------------------------------------------------------------------


def committed():
    with open(os.path.join(DOCS, "accuracy_committed.csv")) as file:
        return {(row["log"], int(row["cameras"]), row["trajectory"]): row for row in csv.DictReader(file)}


def accuracy(path):
    """ATE from 3 s on beside the peers' (table on docs/accuracy.md)."""
    ours = committed()
    peers = {row[0]: row[1:] for row in table("accuracy.md", "log, cameras")}
    logs = runs.DRAWN_LOGS
    figure, axes = panels(1, 2, 3.6, sharey=True)
    names = (("swiftlet", BLUE), ("OpenVINS", ORANGE), ("Basalt", GREEN), ("OKVIS2", PINK))
    for axis, cameras, title in ((axes[0], 2, "two cameras"), (axes[1], 1, "one camera")):
        for k, (name, color) in enumerate(names):
            values = []
            for log in logs:
                if k == 0:
                    values.append(float(ours[(log, cameras, "odometry")]["from_3s_m"]))
                else:
                    cell = peers[f"{log}, {cameras}"][k - 1]
                    values.append(float(re.sub(r"[^0-9.]", "", cell.split("/")[1])))
            x = np.arange(len(logs)) + (k - 1.5) * 0.2
            axis.bar(x, 1e3 * np.array(values), 0.18, color=color, label=name)
            for position, value in zip(x, values):
                axis.text(position, 1e3 * value * 1.06, f"{1e3 * value:.3g}", ha="center", fontsize=8)
        axis.set_xticks(range(len(logs)), logs)
        axis.set(title=title, yscale="log", ylim=(2, 250))
        axis.grid(axis="x", visible=False)
        axis.set_yticks([2, 5, 10, 20, 50, 100, 200], ["2", "5", "10", "20", "50", "100", "200"])
        axis.minorticks_off()
    axes[0].set_ylabel("ATE RMSE from 3 s on [mm]")
    axes[0].legend(loc="upper left", ncols=2, fontsize=9)
    save_svg(figure, path)


def draws(path):
    """Runs that differ in the number of features by 2 %: how much of an error is chance."""
    rows = measured("draws.csv")
    ours = committed()
    figure, axes = panels(1, 2, 3.2)
    for axis, cameras, title in ((axes[0], "2", "two cameras"), (axes[1], "1", "one camera")):
        for k, log in enumerate(runs.DRAWN_LOGS):
            values = [1e3 * float(row["ate_m"]) for row in rows if row["log"] == log and row["cameras"] == cameras]
            spread = np.linspace(-0.18, 0.18, len(values))
            axis.plot(
                k + spread,
                values,
                "o",
                color=SKY,
                markeredgecolor=BLUE,
                markersize=5,
                label="one draw" if k == 0 else None,
            )
            axis.plot(
                [k - 0.25, k + 0.25], [np.mean(values)] * 2, color=BLACK, label="mean of eight" if k == 0 else None
            )
            axis.plot(
                k,
                1e3 * float(ours[(log, int(cameras), "odometry")]["from_3s_m"]),
                "D",
                color=ORANGE,
                markersize=6,
                label="default settings" if k == 0 else None,
            )
        axis.set_xticks(range(len(runs.DRAWN_LOGS)), runs.DRAWN_LOGS)
        axis.set(title=title, ylim=(0, 1.15 * axis.get_ylim()[1]), xlim=(-0.5, 2.5))
        axis.grid(axis="x", visible=False)
    axes[0].set_ylabel("ATE RMSE from 3 s on [mm]")
    axes[1].legend(loc="upper left", fontsize=9)
    save_svg(figure, path)


def full_smoothing_seeds(path):
    rows = table("experiments/accuracy_loops.md", "motion, five seeds")
    names = [row[0].replace("'s,", ",") for row in rows if row[1]]
    mean = np.array([float(row[3]) for row in rows if row[1]])
    least, most = np.array([[float(v) for v in row[4].split(",")] for row in rows if row[1]]).T
    figure, axis = panels(1, 1, 3.6)
    y = np.arange(len(names))[::-1]
    axis.errorbar(mean, y, xerr=[mean - least, most - mean], fmt="o", color=BLUE, ecolor=SKY, elinewidth=3, capsize=0)
    axis.axvline(1, color=RED, linestyle="--", linewidth=1.2)
    axis.text(1.005, y[0] + 0.3, "no gain", color=RED, fontsize=9)
    axis.set_yticks(y, names)
    axis.set(
        xlabel="ATE after full smoothing / ATE of the odometry (mean, least and largest of five seeds)", xlim=(0, 1.1)
    )
    save_svg(figure, path)


def latency(path):
    """CPU time from a frame's images to its pose."""
    rows = measured("latency.csv")
    figure, axis = panels(1, 1, 3.4)
    for kind, color in (("frames", BLUE), ("keyframes", ORANGE)):
        chosen = [row for row in rows if row["kind"] == kind]
        lower = np.array([float(row["from_ms"]) for row in chosen])
        counts = np.array([int(row["count"]) for row in chosen])
        width = lower * (10**0.05 - 1)  # bins of the program: twenty to a decade
        axis.bar(
            lower,
            counts / counts.sum() * 100,
            width,
            align="edge",
            color=color,
            alpha=0.65,
            edgecolor=color,
            label=f"{counts.sum()} {'keyframes' if kind == 'keyframes' else 'other frames'}",
        )
    axis.set_ylim(0, 34)
    for limit, text in ((6, "budget of\nthe median"), (15, "budget of\n99 of 100 frames")):
        axis.axvline(limit, color=RED, linestyle="--", linewidth=1.2)
        axis.text(limit + 0.15, 33.5, f"{text}: {limit} ms", color=RED, fontsize=9, va="top")
    axis.set(xlabel="CPU time from a frame's images to its pose [ms]", ylabel="share of the frames [%]", xlim=(0, 20))
    axis.legend(loc="center right")
    save_svg(figure, path)


def loop_selection(path):
    """What benchmark_loop_selection prints."""
    rows = measured("loop_selection.csv")
    figure, axis = panels(1, 1, 4.0)
    held = [float(row["loops_held"]) for row in rows]
    for column, factor, color, marker, label in (
        ("us_per_new_loop", 1, BLUE, "o", "new loop, mean since the point before"),
        ("us_worst", 1, ORANGE, "s", "new loop, worst"),
        ("ms_one_search", 1e3, GREEN, "^", "one search over all loops"),
    ):
        axis.plot(held, [factor * float(row[column]) for row in rows], marker=marker, color=color, label=label)
    axis.set(xscale="log", yscale="log", xlabel="loops held", ylabel="time [us]")
    axis.legend(loc="upper left")
    save_svg(figure, path)
