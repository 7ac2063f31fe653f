#include <string>

#include "firmware_host/lab/calibrate/guidance/guided_recording.hpp"

namespace swiftlet {

std::string guidancePage() {
  return R"page(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>swiftlet: recording for calibration</title>
<style>
body { font: 16px sans-serif; margin: 1em; background: #16181c; color: #e8e8e8; }
#next { font-size: 1.6em; margin: .4em 0; min-height: 2.4em; }
#cameras { display: flex; flex-wrap: wrap; gap: 1em; }
canvas { width: 100%; background: #000; }
figure { margin: 0; flex: 1 1 24em; max-width: 48em; }
progress { width: 100%; height: 1.2em; }
td { padding: .1em .6em; }
li { opacity: .75; }
</style></head><body>
<progress id="progress" max="1" value="0"></progress>
<div id="next">Waiting for images.</div>
<div id="cameras"></div>
<table id="axes"></table>
<ul id="missing"></ul>
<script>
"use strict";
const byId = (id) => document.getElementById(id);
const canvases = [];
function canvasOf(index) {
  while (canvases.length <= index) {
    const figure = document.createElement("figure");
    const canvas = document.createElement("canvas");
    const caption = document.createElement("figcaption");
    figure.append(canvas, caption);
    byId("cameras").append(figure);
    canvases.push({ canvas, caption });
  }
  return canvases[index];
}
function drawOver(context, camera, state, scale) {
  const w = camera.width * scale / state.columns, h = camera.height * scale / state.rows;
  camera.cells.forEach((count, i) => {
    const x = (i % state.columns) * w, y = Math.floor(i / state.columns) * h;
    const full = count >= state.cell_corners;
    context.fillStyle = full ? "rgba(40, 200, 90, .16)" : "rgba(230, 60, 40, .16)";
    context.fillRect(x, y, w - 1, h - 1);
  });
  context.fillStyle = "#ffd400";
  for (let i = 0; i + 1 < camera.corners.length; i += 2) {
    context.fillRect((camera.corners[i] + .5) * scale - 1.5, (camera.corners[i + 1] + .5) * scale - 1.5, 3, 3);
  }
}
function drawCamera(camera, index, state) {
  const { canvas, caption } = canvasOf(index);
  caption.textContent = "camera " + index + ": board in " + camera.with_board + " of " + camera.images +
    " images, " + camera.blurred + " blurred, edges " + camera.edge_width.toFixed(1) + " px; tilted left " +
    camera.tilted[0] + ", right " + camera.tilted[1] + ", up " + camera.tilted[2] + ", down " + camera.tilted[3];
  if (!camera.picture) return;
  const image = new Image();
  image.onload = () => {
    canvas.width = image.width;
    canvas.height = image.height;
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    drawOver(context, camera, state, image.width / camera.width);
  };
  image.src = camera.picture;
}
function axisRow(name, shares) {
  const row = document.createElement("tr");
  row.insertCell().textContent = name;
  shares.forEach((share, i) => {
    row.insertCell().textContent = "xyz"[i] + " " + Math.min(100, Math.round(100 * share)) + " %";
  });
  return row;
}
function show(state) {
  byId("progress").value = state.progress;
  byId("next").textContent = state.missing.length ? state.missing[0] : "Enough: the recording ends.";
  byId("missing").replaceChildren(...state.missing.slice(1).map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
  byId("axes").replaceChildren(axisRow("turned about", state.turned), axisRow("moved along", state.pushed));
  state.cameras.forEach((camera, index) => drawCamera(camera, index, state));
}
const source = new EventSource("stream" + location.search);
source.addEventListener("state", (event) => show(JSON.parse(event.data)));
source.addEventListener("end", () => { byId("next").textContent = "The recording has ended."; source.close(); });
</script></body></html>
)page";
}

}  // namespace swiftlet
