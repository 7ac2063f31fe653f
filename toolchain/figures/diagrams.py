"""Drawings: plain SVG, 800 px wide."""

import math
from html import escape

from style import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, RED

# Light tones of the palette, to be written on.
FLIGHT, SLOW, DEVICE, OUTPUT = "#d6e8f5", "#d9f0e6", "#eeeeee", "#fbeacc"


class Drawing:
    def __init__(self, height, width=800):
        self.width, self.height = width, height
        self.parts = []

    def add(self, text):
        self.parts.append(text)

    def text(self, x, y, words, size=13, anchor="middle", color=BLACK, bold=False, italic=False):
        style = (' font-weight="bold"' if bold else "") + (' font-style="italic"' if italic else "")
        for k, line in enumerate(words.split("\n")):
            self.add(
                f'<text x="{x:g}" y="{y + k * (size + 3):g}" font-size="{size}" text-anchor="{anchor}" fill="{color}"{style}>'
                f"{escape(line)}</text>"
            )

    def box(self, x, y, w, h, title, words="", fill=FLIGHT, dashed=False, size=13):
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        self.add(f'<rect x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="6" fill="{fill}" stroke="{GREY}"{dash}/>')
        lines = words.split("\n") if words else []
        top = y + h / 2 - (len(lines) * (size + 1)) / 2 + size * 0.35
        self.text(x + w / 2, top, title, size=size, bold=True)
        for k, line in enumerate(lines):
            self.text(x + w / 2, top + (k + 1) * (size + 2), line, size=size - 2)

    def area(self, x, y, w, h, title, fill="none"):
        self.add(f'<rect x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="10" fill="{fill}" stroke="#b5b5b5"/>')
        self.text(x + 10, y + 17, title, size=12, anchor="start", color=GREY, italic=True)

    def line(self, points, color=BLACK, width=1.4, dashed=False):
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        self.add(f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="{width}"{dash}/>')

    def arrow(self, points, color=BLACK, label="", at=None, width=1.4, dashed=False, anchor="middle", size=11):
        (x0, y0), (x1, y1) = points[-2:]
        length = math.hypot(x1 - x0, y1 - y0)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        self.line(points[:-1] + [(x1 - 6 * ux, y1 - 6 * uy)], color, width, dashed)
        corners = [(x1, y1), (x1 - 9 * ux - 4 * uy, y1 - 9 * uy + 4 * ux), (x1 - 9 * ux + 4 * uy, y1 - 9 * uy - 4 * ux)]
        self.add('<polygon points="' + " ".join(f"{x:.4g},{y:.4g}" for x, y in corners) + f'" fill="{color}"/>')
        if label:
            x, y = at or ((points[0][0] + points[1][0]) / 2, (points[0][1] + points[1][1]) / 2 - 5)
            self.text(x, y, label, size=size, color=color, anchor=anchor)

    def circle(self, x, y, r, fill, stroke=GREY, dashed=False):
        dash = ' stroke-dasharray="4 3"' if dashed else ""
        self.add(f'<circle cx="{x:g}" cy="{y:g}" r="{r:g}" fill="{fill}" stroke="{stroke}"{dash}/>')

    def save(self, path):
        with open(path, "w") as file:
            file.write(
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" width="{self.width}" '
                f'height="{self.height}" font-family="DejaVu Sans, Helvetica, Arial, sans-serif">\n'
                f'<rect width="{self.width}" height="{self.height}" fill="white"/>\n'
            )
            file.write("\n".join(self.parts) + "\n</svg>\n")


def architecture(path):
    d = Drawing(500)
    d.area(10, 10, 150, 480, "inputs")
    d.area(180, 10, 440, 255, "odometry and mesh: the flight path")
    d.area(180, 280, 440, 210, "")
    d.text(610, 297, "mapping: low priority, optional", size=12, anchor="end", color=GREY, italic=True)
    d.area(640, 10, 150, 480, "outputs")
    d.box(25, 40, 120, 62, "cameras", "V4L2, GStreamer,\nROS 2 topics", DEVICE)
    d.box(25, 120, 120, 62, "IMU", "serial, CAN,\nMAVLink", DEVICE)
    d.box(25, 200, 120, 46, "trigger", "GPIO: image stamps", DEVICE)
    d.box(25, 290, 120, 76, "or a log", "instead of devices:\nEuRoC, bag, video,\nrecording", DEVICE)
    d.box(25, 400, 120, 62, "depth, labels", "sensor or network,\noptional", DEVICE)

    d.box(200, 45, 110, 62, "track", "features, stereo,\nkeyframes")
    d.box(350, 45, 110, 62, "smooth", "window of\nkeyframes")
    d.box(350, 130, 110, 46, "propagate", "state per sample")
    d.box(500, 45, 105, 62, "mesh", "local surface,\nplanes")
    d.box(200, 205, 405, 46, "supervisor", "health of every thread and sensor, readiness to arm", "#f5f5f5")

    d.box(200, 310, 110, 62, "loop", "places, loop\nselection", SLOW)
    d.box(350, 310, 110, 62, "pose graph", "map at its\nkeyframes", SLOW)
    d.box(200, 412, 110, 62, "depth", "stereo matching\nor sensor", SLOW)
    d.box(350, 412, 110, 62, "volume", "voxels with\nlabels", SLOW)
    d.box(500, 372, 105, 46, "distance", "nearest obstacle", SLOW)
    d.box(500, 430, 105, 46, "surface", "labelled mesh", SLOW)

    d.box(655, 40, 120, 62, "autopilot", "MAVLink: pose,\nobstacles", OUTPUT)
    d.box(655, 120, 120, 46, "ROS 2", "topics", OUTPUT)
    d.box(655, 184, 120, 46, "live view", "browser", OUTPUT)
    d.box(
        655, 312, 120, 90, "run folder", "trajectory, states,\nevents, map;\nrecording, which\nrepeats the run", OUTPUT
    )

    d.arrow([(145, 71), (200, 71)], BLUE, "images", (173, 64))
    d.arrow([(145, 148), (350, 148)], ORANGE, "samples", (250, 142))
    d.arrow([(255, 148), (255, 107)], ORANGE)
    d.arrow([(375, 130), (375, 107)], ORANGE)
    d.arrow([(435, 107), (435, 130)], BLUE, "fix", (440, 122), anchor="start")
    d.arrow([(310, 66), (350, 66)], BLUE, "tracks", (330, 60), size=10)
    d.arrow([(350, 92), (310, 92)], BLUE, "predict", (330, 104), size=10)
    d.arrow([(460, 66), (500, 66)], BLUE, "window", (480, 60), size=10)
    d.arrow([(500, 92), (460, 92)], BLUE, "planes", (480, 104), size=10)
    d.arrow([(460, 158), (655, 143)], BLUE)
    d.arrow([(605, 76), (655, 76)], BLUE)
    d.text(555, 166, "pose, velocity, covariance", size=11, color=BLUE)
    d.arrow([(605, 222), (655, 210)], GREY)
    d.arrow([(405, 176), (405, 205)], GREY)
    d.arrow([(255, 265), (255, 310)], GREEN, "keyframes, images", (261, 277), anchor="start")
    d.arrow([(190, 265), (190, 425), (200, 425)], GREEN)
    d.arrow([(310, 341), (350, 341)], GREEN, "loops", (330, 335), size=10)
    d.arrow([(405, 372), (405, 412)], GREEN, "corrections", (411, 396), anchor="start")
    d.arrow([(310, 443), (350, 443)], GREEN)
    d.arrow([(460, 430), (500, 400)], GREEN)
    d.arrow([(460, 453), (500, 453)], GREEN)
    d.arrow([(145, 440), (200, 440)], GREEN)
    d.arrow([(460, 335), (655, 335)], GREEN, "T_map_world, map.tum", (556, 329))
    d.arrow([(605, 453), (630, 453), (630, 375), (655, 375)], GREEN)
    d.save(path)


def threads(path):
    """firmware_host/graph/graph.cpp, drawn: rings keep everything, newest values are overwritten, slots go back."""
    d = Drawing(575)
    ring, newest, slots = BLUE, RED, GREEN
    d.box(20, 60, 140, 70, "sensor", "imu, camera0,\ncamera1, trigger:\nhighest priority", DEVICE)
    d.box(250, 20, 150, 56, "propagate", "a state per sample")
    d.box(250, 130, 150, 56, "track", "pairing, features")
    d.box(470, 130, 150, 56, "smooth", "states, covariance")
    d.box(470, 250, 150, 56, "mesh", "local mesh, planes")
    d.box(250, 250, 150, 56, "loop", "low priority", SLOW)
    d.box(250, 350, 150, 56, "map", "low priority", SLOW)
    d.box(655, 20, 130, 56, "log", "lowest priority", OUTPUT)
    d.box(655, 350, 130, 76, "outputs", "autopilot, view, dds:\nnewest state, mesh,\nverdict", OUTPUT)
    d.box(20, 350, 150, 56, "record", "lowest priority", OUTPUT)
    d.box(20, 250, 150, 56, "supervisor", "reads all heartbeats", "#f5f5f5")

    d.arrow([(160, 75), (210, 75), (210, 48), (250, 48)], ring, "samples", (162, 71), anchor="start")
    d.arrow([(160, 103), (225, 103), (225, 145), (250, 145)], ring, "samples", (228, 118), anchor="start")
    d.arrow([(130, 130), (130, 168), (250, 168)], slots, "images", (190, 163))
    d.arrow([(160, 88), (545, 88), (545, 130)], ring, "samples", (440, 83))
    d.arrow([(400, 150), (470, 150)], ring, "tracks", (435, 145))
    d.arrow([(470, 172), (400, 172)], newest, "window", (435, 185))
    d.arrow([(500, 130), (500, 58), (400, 58)], newest, "fix", (450, 53))
    d.arrow([(400, 38), (655, 38)], ring, "states", (530, 33))
    d.arrow([(620, 150), (700, 150), (700, 76)], ring, "results", (705, 118), anchor="start")
    d.arrow([(530, 186), (530, 250)], newest, "window", (536, 206), anchor="start")
    d.arrow([(590, 250), (590, 186)], newest, "planes", (584, 238), anchor="end")
    d.arrow([(620, 278), (735, 278), (735, 76)], newest, "mesh", (680, 273))
    d.arrow([(482, 186), (482, 215), (360, 215), (360, 250)], ring, "keyframes", (368, 210), anchor="start")
    d.arrow([(300, 186), (300, 250)], slots, "copies of images", (294, 214), anchor="end")
    d.arrow([(325, 306), (325, 350)], newest, "corrections", (331, 334), anchor="start")
    d.arrow([(495, 186), (495, 228), (440, 228), (440, 378), (400, 378)], ring, "frames", (446, 372), anchor="start")
    d.arrow([(620, 168), (640, 168), (640, 388), (655, 388)], newest, "newest state", (634, 340), anchor="end")
    d.arrow(
        [(60, 130), (60, 232), (10, 232), (10, 378), (20, 378)], slots, "all that enters", (64, 215), anchor="start"
    )
    y = 450
    d.text(
        20,
        y,
        "how an arrow carries, and what happens when the reader is late",
        size=12,
        anchor="start",
        color=GREY,
        italic=True,
    )
    for k, (color, name, words) in enumerate(
        (
            (ring, "ring", "every value in order; a full ring refuses the value and counts it"),
            (newest, "newest value", "overwritten by the next; numbers show the gap; the reader never waits"),
            (slots, "slots of a fixed pool", "the oldest waiting image goes back to the writer, counted"),
        )
    ):
        d.arrow([(20, y + 22 + 24 * k), (70, y + 22 + 24 * k)], color, width=2)
        d.text(80, y + 26 + 24 * k, name, size=12, anchor="start", bold=True, color=color)
        d.text(250, y + 26 + 24 * k, words, size=12, anchor="start")
    d.text(
        20,
        y + 100,
        "The sensor and the blue boxes are the flight path: no lock, no allocation, no wait for a green or yellow box.",
        size=12,
        anchor="start",
    )
    d.text(
        20,
        y + 117,
        "Not drawn: images of camera 0 to mesh; copies of images, depth and labels to map; what each step took to record.",
        size=12,
        anchor="start",
    )
    d.save(path)


def frames(path):
    d = Drawing(330)

    def axes(x, y, angle, scale, names, second=90):
        for k, (turn, color) in enumerate(((0, RED), (second, GREEN))):
            a = math.radians(angle + turn)
            d.arrow([(x, y), (x + scale * math.cos(a), y - scale * math.sin(a))], color, width=2.2)
            d.text(x + (scale + 10) * math.cos(a), y - (scale + 10) * math.sin(a) + 4, names[k], size=11, color=color)

    def name(x, y, words, about):
        d.text(x, y, words, size=14, bold=True)
        d.text(x, y + 16, about, size=11, color=GREY)

    axes(75, 220, 0, 55, "xz")
    name(85, 246, "map", "after loop closure, z up")
    axes(275, 200, 0, 55, "xz")
    name(300, 226, "world", "where odometry began:\nz up, never jumps")
    axes(520, 110, 20, 55, "xz")
    name(530, 140, "body", "the IMU")
    axes(690, 55, -12, 45, "zy", -90)
    name(730, 30, "cam0", "")
    axes(690, 190, -12, 45, "zy", -90)
    name(735, 165, "cam1", "")
    d.text(690, 265, "z along the optical axis,\nx right, y down in the image", size=11, color=GREY)
    d.arrow([(90, 205), (165, 165), (262, 194)], BLUE, "T_map_world", (165, 150), dashed=True)
    d.text(165, 134, "moves when loops are closed", size=11, color=GREY)
    d.arrow([(285, 185), (375, 85), (508, 106)], BLUE, "T_world_body", (375, 72))
    d.text(375, 56, "what the odometry estimates", size=11, color=GREY)
    d.arrow([(535, 92), (590, 45), (678, 52)], BLUE, "T_body_cam0", (585, 36))
    d.arrow([(540, 115), (610, 195), (678, 191)], BLUE, "T_body_cam1", (605, 214))
    d.text(
        400,
        312,
        "T_A_B takes coordinates in B to coordinates in A:  p_map = T_map_world T_world_body T_body_cam0 p_cam0",
        size=12,
    )
    d.save(path)


def window(path):
    """The fixed lag's window (estimator/smoother), with the default numbers of its states."""
    d = Drawing(430)
    y = 230
    pose, motion, recent = "#d9f0e6", "#d6e8f5", "#fbeacc"
    xs = [110 + 42 * k for k in range(16)]
    kinds = [pose] * 7 + [motion] * 5 + [recent] * 4
    d.area(86, 180, 292, 96, "")
    d.area(380, 180, 208, 96, "")
    d.area(590, 180, 170, 96, "")
    d.text(232, 294, "7 keyframes: pose only", size=12)
    d.text(484, 294, "5 keyframes: pose,", size=12)
    d.text(484, 309, "velocity, biases", size=12)
    d.text(675, 294, "4 newest frames:", size=12)
    d.text(675, 309, "the same", size=12)
    # Landmarks and what sees them.
    landmarks = (
        (150, (0, 1, 2, 3)),
        (275, (2, 3, 4, 5, 6)),
        (400, (5, 6, 7, 8, 9)),
        (540, (8, 9, 10, 11, 12, 13)),
        (670, (11, 12, 13, 14, 15)),
    )
    for x, seen in landmarks:
        for k in seen:
            d.line([(x, 118), (xs[k], y - 14)], "#9a9a9a", 0.9)
    for x, _ in landmarks:
        d.add(
            f'<rect x="{x - 9}" y="104" width="18" height="18" fill="{PINK}" stroke="{GREY}" transform="rotate(45 {x} 113)"/>'
        )
    d.text(400, 82, "landmarks: eliminated while the system is built (Schur complement)", size=12)
    for k in range(7, 15):
        d.line([(xs[k] + 14, y), (xs[k + 1] - 14, y)], ORANGE, 2)
        d.add(f'<rect x="{(xs[k] + xs[k + 1]) / 2 - 4:g}" y="{y - 4}" width="8" height="8" fill="{ORANGE}"/>')
    for x, kind in zip(xs, kinds):
        d.circle(x, y, 14, kind)
    d.text(xs[11] + 10, 268, "IMU factors between states with motion", size=11, color="#9a6a00")
    # What left.
    d.circle(40, y, 14, "white", dashed=True)
    d.add(f'<rect x="66" y="{y - 6}" width="12" height="12" fill="{BLACK}"/>')
    d.line([(78, y), (96, y)], BLACK, 2)
    d.line([(72, y + 6), (72, y + 96), (600, y + 96), (600, y + 84)], BLACK, 1)
    d.line([(232, y + 96), (232, y + 70)], BLACK, 1)
    d.line([(484, y + 96), (484, y + 84)], BLACK, 1)
    d.text(400, y + 112, "prior: what the marginalized states and their landmarks said of those that stay", size=12)
    d.text(400, 24, "time: oldest left, newest right", size=12, color=GREY, italic=True)
    d.arrow([(300, 34), (500, 34)], GREY)
    d.text(
        20,
        y + 146,
        "Leave: a keyframe's velocity and biases when it gets older than the 9 newest states with motion, and one pose-only",
        size=11.5,
        anchor="start",
    )
    d.text(
        20,
        y + 163,
        "keyframe when there are more than 7: both are marginalized into the prior. A frame that is no keyframe is dropped",
        size=11.5,
        anchor="start",
    )
    d.text(20, y + 180, "behind the 4 newest; its two IMU intervals become one.", size=11.5, anchor="start")
    d.save(path)
