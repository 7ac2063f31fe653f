"""Screenshots of the program's own pages in headless Chromium, which is led over its debugging pipe."""

import base64
import fcntl
import io
import json
import os
import shutil
import subprocess
import time

from PIL import Image

import runs
from style import save_jpeg

WIDTH = 1280


class Browser:
    """One page. Messages are JSON ended by a zero byte, on descriptors 3 (to the browser) and 4 (from it)."""

    def __init__(self, height):
        program = shutil.which("chromium") or shutil.which("google-chrome")
        if not program:
            raise SystemExit("figures: there is no chromium; toolchain/install.sh test")
        profile = os.path.join(runs.WORK, "browser")
        shutil.rmtree(profile, ignore_errors=True)
        (read3, write3), (read4, write4) = os.pipe(), os.pipe()
        theirs = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (read3, write4)]

        def place():
            os.dup2(theirs[0], 3)
            os.dup2(theirs[1], 4)

        self.process = subprocess.Popen(
            [
                program,
                "--headless",
                "--no-sandbox",
                "--use-gl=angle",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--hide-scrollbars",
                f"--user-data-dir={profile}",
                "--remote-debugging-pipe",
                "about:blank",
            ],
            close_fds=False,
            preexec_fn=place,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for end in (read3, write4, *theirs):
            os.close(end)
        self.to, self.answers = os.fdopen(write3, "wb"), os.fdopen(read4, "rb")
        self.sent, self.session = 0, None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Emulation.setDeviceMetricsOverride", width=WIDTH, height=height, deviceScaleFactor=1, mobile=False)

    def call(self, method, **parameters):
        self.sent += 1
        message = {"id": self.sent, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        self.to.write(json.dumps(message).encode() + b"\0")
        self.to.flush()
        while True:
            text = bytearray()
            while (byte := self.answers.read(1)) != b"\0":
                if not byte:
                    raise SystemExit("figures: chromium has ended")
                text += byte
            answer = json.loads(text)
            if answer.get("id") == self.sent:
                if "error" in answer:
                    raise SystemExit(f"figures: chromium: {answer['error']}")
                return answer["result"]

    def wait_for(self, expression, most_s=120):
        for _ in range(int(most_s / 0.5)):
            answer = self.call("Runtime.evaluate", expression=expression)
            if answer["result"].get("value") is True:
                return
            time.sleep(0.5)
        raise SystemExit(f"figures: the page does not come to {expression}")

    def picture(self):
        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return Image.open(io.BytesIO(png)).convert("RGB")

    def close(self):
        self.process.terminate()
        self.process.wait()


def report(path):
    page = os.path.join(runs.WORK, "report.html")
    runs.swiftlet("report", runs.v102(), "--out", page)
    browser = Browser(1480)
    try:
        browser.call("Page.navigate", url="file://" + page)
        browser.wait_for("document.body.innerText.includes('grid 1 m')")  # the legend of the 3D view
        time.sleep(3)  # for the surfaces to be drawn
        save_jpeg(browser.picture(), path)
    finally:
        browser.close()


def view(path):
    """The live view of a log that is replayed in real time, of which the moment is not the same each time."""
    moment_s = 12
    words = os.path.join(runs.WORK, "view.log")
    browser = Browser(1860)  # down to the end of the 3D view
    with open(words, "w") as log:
        run = subprocess.Popen(
            [
                runs.SWIFTLET,
                "replay",
                runs.log_folder("vil_v102"),
                "--real-time",
                "--speed",
                "0.25",  # so that a browser that renders in software keeps up
                "--map",
                "--out",
                os.path.join(runs.WORK, "view_run"),
                "--view",
                "127.0.0.1:0",
            ],
            stdout=log,
            stderr=log,
        )
    try:
        address = None
        while address is None:
            time.sleep(0.05)
            if run.poll() is not None:
                raise SystemExit(f"figures: no live view; see {words}")
            with open(words) as log:
                address = next((word for word in log.read().split() if word.startswith("http://")), None)
        browser.call("Page.navigate", url=address)
        # The bar at the top tells the time of the newest state; other times on the page are shorter.
        times = r"[...document.body.innerText.matchAll(/(\d+\.\d) s/g)].map(found => parseFloat(found[1]))"
        browser.wait_for(f"Math.max(0, ...{times}) >= {moment_s}")
        save_jpeg(browser.picture(), path)
    finally:
        browser.close()
        run.terminate()
        run.wait()
