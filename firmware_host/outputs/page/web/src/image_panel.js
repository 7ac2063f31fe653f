// The cameras' images of one instant, with what the estimator made of them drawn over them. The message is described
// in docs/view.md.

import { element } from './tables.js';

const kTail = 0.5; // s of a track's earlier pixels

// Fill or stroke of each layer; tracks by kind: followed, landmark of the window.
const kTrackColours = ['#ffd84a', '#4fe06a'];
const kLayers = [
  ['tracks', 'tracks', kTrackColours[1]],
  ['tails', 'tails', kTrackColours[0]],
  ['stereo', 'stereo matches', '#4fd8e8'],
  ['rejected', 'rejected', '#ff5a5a'],
  ['mesh', 'mesh', '#7aa8ff'],
  ['loop', 'loop matches', '#ff6ad5'],
];
const colours = Object.fromEntries(kLayers.map(([id, , colour]) => [id, colour]));
const kRejected = ['lost', 'contradict the motion', 'contradict the other camera'];

/** What is switched on, for all panels of the page: it outlives a document. */
const on = { tracks: true, tails: true, stereo: false, rejected: true, mesh: false, loop: true };

const number = (value, digits) => value.toFixed(digits);

export class ImagePanel {
  /** `cameras`: [{width, height}] of the raw images [px]. */
  constructor(host, width, cameras) {
    this.shown = 0;
    this.tails = cameras.map(() => new Map()); // by id: [t, x, y, t, x, y ...]
    this.drawn = {};
    host.append(this.toggles());
    const row = element('div', null, 'images');
    host.append(row);
    this.inSight = true;
    this.sight = new IntersectionObserver(([entry]) => {
      this.inSight = entry.isIntersecting;
      this.work();
    });
    this.sight.observe(row);
    const gap = 10;
    const each = Math.floor((width - gap * (cameras.length - 1)) / cameras.length);
    this.views = cameras.map((camera, i) => {
      const figure = element('figure');
      figure.dataset.camera = i;
      const canvas = element('canvas');
      const caption = element('figcaption', `camera ${i}: no image yet`);
      figure.append(canvas, caption);
      row.append(figure);
      const shownWidth = Math.min(each, camera.width);
      const scale = shownWidth / camera.width;
      const sharp = window.devicePixelRatio || 1;
      canvas.width = Math.round(shownWidth * sharp);
      canvas.height = Math.round(camera.height * scale * sharp);
      canvas.style.width = `${shownWidth}px`;
      figure.style.width = `${shownWidth}px`;
      return { canvas, caption, scale: scale * sharp, sharp, image: null };
    });
  }

  toggles() {
    const bar = element('div', null, 'layers');
    for (const [id, name, colour] of kLayers) {
      const label = element('label', null, 'layer');
      const box = element('input');
      box.type = 'checkbox';
      box.checked = on[id];
      box.dataset.layer = id;
      box.addEventListener('change', () => {
        on[id] = box.checked;
        this.draw();
      });
      const mark = element('i');
      mark.style.background = colour;
      label.append(box, mark, name);
      bar.append(label);
    }
    return bar;
  }

  /** Shows an instant. While pictures are decoded, or the panel is out of sight, only the newest that comes waits. */
  show(message) {
    this.waiting = message;
    return this.work();
  }

  async work() {
    if (this.busy) return;
    this.busy = true;
    while (this.waiting && this.inSight) {
      const next = this.waiting;
      this.waiting = null;
      const images = await Promise.all(next.cameras.map((camera) => camera && decoded(camera.src)));
      if (this.disposed) return;
      this.take(next, images);
    }
    this.busy = false;
  }

  take(message, images) {
    const before = this.message?.t;
    if (before != null && !(message.t >= before && message.t - before <= kTail)) {
      for (const tails of this.tails) tails.clear();
    }
    this.message = message;
    message.cameras.forEach((camera, i) => {
      const view = this.views[i];
      if (!view) return;
      view.image = images[i] ?? null;
      view.caption.textContent = caption(message, camera, i);
      this.follow(this.tails[i], camera?.tracks ?? [], message.t);
    });
    this.shown += 1;
    this.draw();
  }

  follow(tails, tracks, t) {
    const seen = new Set();
    each(tracks, 4, (id, x, y) => {
      seen.add(id);
      const tail = tails.get(id) ?? [];
      while (tail.length && t - tail[0] > kTail) tail.splice(0, 3);
      tail.push(t, x, y);
      tails.set(id, tail);
    });
    for (const id of tails.keys()) if (!seen.has(id)) tails.delete(id);
  }

  draw() {
    if (!this.message) return;
    this.drawn = Object.fromEntries(kLayers.map(([id]) => [id, 0]));
    this.views.forEach((view, i) => {
      const context = view.canvas.getContext('2d');
      context.fillStyle = '#10151a';
      context.fillRect(0, 0, view.canvas.width, view.canvas.height);
      if (!view.image) return;
      context.drawImage(view.image, 0, 0, view.canvas.width, view.canvas.height);
      this.drawOver(context, view, i);
    });
  }

  drawOver(context, view, index) {
    const camera = this.message.cameras[index];
    const at = (v) => (v + 0.5) * view.scale;
    const lines = (layer, path) => {
      if (!on[layer]) return;
      context.strokeStyle = colours[layer];
      context.lineWidth = view.sharp * (layer === 'mesh' ? 0.6 : 1.2);
      context.beginPath();
      path((x0, y0, x1, y1) => {
        context.moveTo(at(x0), at(y0));
        context.lineTo(at(x1), at(y1));
        this.drawn[layer] += 1;
      });
      context.stroke();
    };
    const { mesh, tracks = [], rejected = [], loop } = camera;
    if (mesh) {
      const v = mesh.vertices;
      lines('mesh', (line) => each(mesh.edges, 2, (i, j) => line(v[2 * i], v[2 * i + 1], v[2 * j], v[2 * j + 1])));
    }
    lines('stereo', (line) => {
      const partners = new Map();
      each(this.message.cameras[1 - index]?.tracks ?? [], 4, (id, x, y) => partners.set(id, [x, y]));
      each(tracks, 4, (id, x, y) => partners.has(id) && line(x, y, ...partners.get(id)));
    });
    lines('tails', (line) => {
      for (const tail of this.tails[index].values()) {
        for (let i = 3; i < tail.length; i += 3) line(tail[i - 2], tail[i - 1], tail[i + 1], tail[i + 2]);
      }
    });
    lines('loop', (line) => each(loop?.matches ?? [], 4, line));
    const arm = 3.5 * view.sharp / view.scale; // px of the image
    lines('rejected', (line) => each(rejected, 3, (x, y) => {
      line(x - arm, y - arm, x + arm, y + arm);
      line(x - arm, y + arm, x + arm, y - arm);
    }));
    if (!on.tracks) return;
    const size = 3 * view.sharp;
    each(tracks, 4, (id, x, y, kind) => {
      context.fillStyle = kTrackColours[kind] ?? kTrackColours[0];
      context.fillRect(at(x) - size / 2, at(y) - size / 2, size, size);
      this.drawn.tracks += 1;
    });
  }

  /** What each layer has drawn last. */
  count() {
    return this.drawn;
  }

  dispose() {
    this.disposed = true;
    this.sight.disconnect();
  }
}

/** Calls take() with `step` values at a time. */
function each(values, step, take) {
  for (let i = 0; i + step <= values.length; i += step) take(...values.slice(i, i + step));
}

function decoded(src) {
  const image = new Image();
  image.src = src;
  return image.decode().then(() => image, () => null);
}

function caption(message, camera, index) {
  if (!camera) return `camera ${index}: no image at ${number(message.t, 2)} s`;
  const parts = [`camera ${index}: ${number(message.t, 2)} s`];
  if (message.keyframe) parts.push('keyframe');
  if (camera.rate_hz != null) parts.push(`${number(camera.rate_hz, 1)} Hz`);
  if (camera.exposure_ms != null) parts.push(`exposure ${number(camera.exposure_ms, 2)} ms`);
  if (camera.gain != null) parts.push(`gain ${number(camera.gain, 1)}`);
  if (camera.tracks) parts.push(`${camera.tracks.length / 4} tracks`);
  const refused = [0, 0, 0];
  each(camera.rejected ?? [], 3, (x, y, why) => { refused[why] += 1; });
  refused.forEach((count, why) => count && parts.push(`${count} ${kRejected[why]}`));
  if (camera.loop) parts.push(camera.loop.text);
  if (camera.note) parts.push(camera.note);
  return parts.join(', ');
}
