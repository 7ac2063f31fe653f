// The 3D view: trajectories and surfaces, to be turned, with layers and the colour of one's choice.

import {
  AmbientLight, AxesHelper, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, FrontSide, GridHelper,
  Mesh, MeshLambertMaterial, PerspectiveCamera, Points, PointsMaterial, Scene, Vector3, WebGLRenderer, Box3,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { Line2 } from 'three/examples/jsm/lines/Line2.js';
import { LineGeometry } from 'three/examples/jsm/lines/LineGeometry.js';
import { LineMaterial } from 'three/examples/jsm/lines/LineMaterial.js';
import * as colours from './colours.js';
import { Cloud } from './cloud.js';
import { bounds, bytes, floats, grown, shorts } from './columns.js';
import { grey, height, kUnlabelled, labelColours, share } from './surface_colours.js';
import { element } from './tables.js';

const kLookAnew = 2000; // ms between two looks at what a growing scene holds

class Surface {
  constructor(data, labels) {
    this.data = data;
    this.labels = labelColours(labels);
    this.label = bytes(data.labels);
    this.error = bytes(data.error);
    this.grey = bytes(data.grey);
    this.corner = shorts(data.triangles);
    const whole = shorts(data.points);
    // Corners of their own for each triangle: its label colours it alone.
    const positions = new Float32Array(this.corner.length * 3);
    for (let i = 0; i < this.corner.length; ++i) {
      for (let k = 0; k < 3; ++k) {
        positions[3 * i + k] = data.low[k] + (whole[3 * this.corner[i] + k] / 65535) * data.size[k];
      }
    }
    this.geometry = new BufferGeometry();
    this.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.geometry.setAttribute('color', new BufferAttribute(new Float32Array(positions.length), 3));
    this.geometry.computeVertexNormals();
    // Seen from the free side only: a room is looked into from outside.
    this.object = new Mesh(this.geometry, new MeshLambertMaterial({ vertexColors: true, side: FrontSide }));
  }

  ways() {
    const ways = ['height'];
    if (this.grey.length) ways.unshift('as seen');
    if (this.label.length) ways.unshift('label');
    if (this.error.length) ways.push('error');
    return ways;
  }

  colour(way, heights) {
    const positions = this.geometry.attributes.position.array;
    const target = this.geometry.attributes.color;
    // A way that this surface lacks: the first that it has.
    const chosen = this.ways().includes(way) ? way : this.ways()[0];
    const ramp = height(heights);
    for (let i = 0; i < this.corner.length; ++i) {
      let rgb;
      if (chosen === 'label') {
        const label = this.label[Math.floor(i / 3)];
        rgb = label ? this.labels[label - 1] ?? kUnlabelled : kUnlabelled;
      } else if (chosen === 'error') {
        rgb = share(this.error[this.corner[i]] / 255);
      } else if (chosen === 'height') {
        rgb = ramp(positions[3 * i + 2]);
      } else {
        rgb = grey(this.grey[this.corner[i]]);
      }
      target.array.set(rgb, 3 * i);
    }
    target.needsUpdate = true;
  }
}

class Trajectory {
  constructor(data) {
    this.data = data;
    this.points = floats(data.points);
    this.value = floats(data.value);
    this.t = floats(data.t);
    this.object = data.style === 'points' ? this.makePoints() : this.makeLine();
  }

  makePoints() {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(this.points, 3));
    return new Points(geometry, new PointsMaterial({ color: colours.lines[3], size: 4, sizeAttenuation: false }));
  }

  makeLine() {
    const coloured = this.data.value != null;
    this.range = bounds([this.value]);
    const material = new LineMaterial({
      color: coloured ? 0xffffff : 0x808080, linewidth: coloured ? 3 : 2, vertexColors: coloured,
    });
    this.line = new Line2(this.lineGeometry(), material);
    return this.line;
  }

  lineGeometry() {
    const geometry = new LineGeometry();
    const points = this.points.length >= 6 ? this.points : new Float32Array(6);
    geometry.setPositions(points);
    if (this.value.length) {
      const [low, high] = this.range;
      const rgb = [];
      for (let i = 0; i < points.length / 3; ++i) {
        rgb.push(...share((this.value[i] - low) / (high - low || 1)));
      }
      geometry.setColors(rgb);
    }
    return geometry;
  }

  /** What was flown until then. */
  until(t) {
    if (!this.t.length) return;
    let count = this.t.findIndex((one) => one > t);
    if (count < 0) count = this.t.length;
    if (this.line) this.line.geometry.instanceCount = Math.max(0, count - 1);
    else this.object.geometry.setDrawRange(0, count);
  }

  append(points, value, replace) {
    this.points = grown(this.points, floats(points), replace, 3);
    if (value != null) this.value = grown(this.value, floats(value), replace);
    if (this.line) {
      this.range = bounds([this.value]);
      this.line.geometry.dispose();
      this.line.geometry = this.lineGeometry();
    } else {
      this.object.geometry.setAttribute('position', new BufferAttribute(this.points, 3));
    }
  }
}

export class SceneView {
  constructor(data, host, width, height) {
    this.data = data;
    this.host = host;
    this.scene = new Scene();
    this.scene.background = new Color('#f6f7f8');
    this.scene.add(new AmbientLight(0xffffff, 1.9));
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(2, -3, 6);
    this.scene.add(sun);
    // Without a graphics card smooth edges cost more than they are worth.
    const software = /swiftshader|llvmpipe|software/i.test(SceneView.renderer());
    this.renderer = new WebGLRenderer({ antialias: !software, powerPreference: 'low-power' });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.camera = new PerspectiveCamera(50, width / height, 0.05, 5000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener('change', () => this.draw());
    this.controls.addEventListener('start', () => { this.touched = true; });
    this.surfaces = [
      ...data.surfaces.map((s) => new Surface(s, data.labels ?? [])),
      ...(data.clouds ?? []).map((c) => new Cloud(c, data.labels ?? [])),
    ];
    this.trajectories = data.trajectories.map((t) => new Trajectory(t));
    for (const layer of [...this.surfaces, ...this.trajectories]) this.scene.add(layer.object);
    this.bar = element('div', null, 'layers');
    this.legend = element('div', null, 'legend');
    host.append(this.bar, this.renderer.domElement, this.legend);
    if (data.pose) this.move(data.pose);
    this.makeBar();
    this.findBounds();
    this.addGrid();
    this.colour(this.ways()[0]);
    this.renderer.setSize(width, height);
    this.look(new Vector3(0.8, -1.2, 0.9));
    this.seen = true;
    this.watch = new IntersectionObserver((entries) => {
      this.seen = entries.at(-1).isIntersecting;
      if (this.seen) this.draw();
    });
    this.watch.observe(this.renderer.domElement);
  }

  /** The vehicle: its axes. */
  move([x, y, z, qx, qy, qz, qw]) {
    if (!this.vehicle) {
      this.vehicle = new AxesHelper(1);
      this.scene.add(this.vehicle);
    }
    this.vehicle.position.set(x, y, z);
    this.vehicle.quaternion.set(qx, qy, qz, qw);
  }

  /** A moment of a run that is over. */
  showMoment(t, pose) {
    for (const trajectory of this.trajectories) trajectory.until(t);
    if (pose) {
      const first = !this.vehicle;
      this.move(pose);
      if (first) this.addGrid();
    }
    if (this.vehicle) this.vehicle.visible = pose != null;
    this.draw();
  }

  dispose() {
    this.watch.disconnect();
    cancelAnimationFrame(this.waiting);
    for (const layer of [...this.surfaces, ...this.trajectories]) layer.object.geometry.dispose();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** What draws: '' without WebGL. */
  static renderer() {
    SceneView.drawnBy ??= (() => {
      const gl = document.createElement('canvas').getContext('webgl2');
      if (!gl) return '';
      const info = gl.getExtension('WEBGL_debug_renderer_info');
      return String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) || 'unknown';
    })();
    return SceneView.drawnBy;
  }

  ways() {
    return [...new Set(this.surfaces.flatMap((s) => s.ways()))];
  }

  makeBar() {
    const before = this.way?.value;
    this.bar.replaceChildren();
    for (const layer of [...this.surfaces, ...this.trajectories]) {
      const label = element('label');
      const box = element('input');
      box.type = 'checkbox';
      box.checked = layer.object.visible;
      box.addEventListener('change', () => {
        const shown = [...this.surfaces, ...this.trajectories].find((l) => l.data.name === layer.data.name);
        shown.object.visible = box.checked;
        this.draw();
      });
      label.append(box, layer.data.name);
      if (layer.data.note) label.title = layer.data.note;
      this.bar.append(label);
    }
    if (this.surfaces.length) {
      const select = element('select');
      for (const way of this.ways()) select.append(element('option', way));
      if (before && this.ways().includes(before)) select.value = before;
      this.way = select;
      select.addEventListener('change', () => {
        this.colour(select.value);
        this.draw();
      });
      const label = element('label', 'colour by ');
      label.append(select);
      const both = element('label');
      both.title = 'Surfaces have a free side; from behind one sees through them';
      const box = element('input');
      box.type = 'checkbox';
      box.checked = Boolean(this.bothSides);
      box.addEventListener('change', () => {
        this.bothSides = box.checked;
        for (const surface of this.surfaces) this.side(surface);
        this.draw();
      });
      both.append(box, 'both sides');
      this.bar.append(label, both);
    }
    for (const [name, from] of [['from above', [0, -0.001, 1]], ['from the side', [0, -1, 0.05]], ['oblique', [0.8, -1.2, 0.9]]]) {
      const button = element('button', name);
      button.addEventListener('click', () => {
        this.touched = false;
        this.from = from;
        this.look(new Vector3(...from));
      });
      this.bar.append(button);
    }
  }

  side(surface) {
    surface.object.material.side = this.bothSides ? DoubleSide : FrontSide;
    surface.object.material.needsUpdate = true;
  }

  /** Where nearly all of it is: a triangle far out does not make the rest small. */
  findBounds() {
    const layers = [...this.surfaces, ...this.trajectories];
    this.box = new Box3(new Vector3(-1, -1, -1), new Vector3(1, 1, 1));
    const kOutside = 0.01;
    for (const [k, axis] of ['x', 'y', 'z'].entries()) {
      const values = [];
      for (const layer of layers) {
        const points = layer.points ?? layer.geometry.attributes.position.array;
        const step = 3 * Math.max(1, Math.floor(points.length / 60000));
        for (let i = k; i < points.length; i += step) values.push(points[i]);
      }
      if (!values.length) continue;
      values.sort((one, other) => one - other);
      const inside = this.trajectories.flatMap((t) => bounds([t.points.filter((_, i) => i % 3 === k)]));
      this.box.min[axis] = Math.min(values[Math.floor(kOutside * (values.length - 1))], ...inside);
      this.box.max[axis] = Math.max(values[Math.ceil((1 - kOutside) * (values.length - 1))], ...inside);
    }
  }

  addGrid() {
    if (this.grid) {
      this.scene.remove(this.grid);
      this.grid.dispose();
    }
    const size = this.box.getSize(new Vector3());
    const wide = Math.max(2, Math.ceil(Math.max(size.x, size.y) * 1.2));
    const cells = wide > 60 ? Math.ceil(wide / 10) : wide;
    const grid = new GridHelper(wide, cells, 0x9aa4ad, 0xdadfe3);
    grid.rotation.x = Math.PI / 2;
    const middle = this.box.getCenter(new Vector3());
    grid.position.set(middle.x, middle.y, this.box.min.z);
    this.cell = wide / cells;
    this.grid = grid;
    this.scene.add(grid);
    this.vehicle?.scale.setScalar(Math.max(0.2, 0.04 * size.length()));
  }

  colour(way) {
    const heights = [this.box.min.z, this.box.max.z];
    for (const surface of this.surfaces) surface.colour(way, heights);
    this.makeLegend(way);
  }

  makeLegend(way) {
    const heights = [this.box.min.z, this.box.max.z];
    this.legend.replaceChildren(element('span', `grid ${this.cell} m`));
    if (way === 'height') this.legend.append(colours.scaleLegend('height [m]', ...heights));
    if (way === 'error') {
      const most = Math.max(...this.surfaces.map((s) => s.data.error_most ?? 0));
      this.legend.append(colours.scaleLegend('distance from the true surface [m]', 0, most));
    }
    if (way === 'label') {
      const present = new Set(this.surfaces.flatMap((s) => [...new Set(s.label)]));
      for (const label of [...present].sort((a, b) => a - b)) {
        if (label === 0) continue;
        const name = element('span', this.data.labels[label - 1].name, 'label');
        name.style.borderColor = this.data.labels[label - 1].colour;
        this.legend.append(name);
      }
    }
    for (const trajectory of this.trajectories) {
      if (trajectory.value.length) {
        this.legend.append(colours.scaleLegend(`${trajectory.data.name}: ${trajectory.data.value_label}`, ...trajectory.range));
      }
    }
  }

  look(direction) {
    const middle = this.box.getCenter(new Vector3());
    const radius = Math.max(this.box.getSize(new Vector3()).length() / 2, 0.5);
    const far = radius / Math.sin(((this.camera.fov / 2) * Math.PI) / 180) / Math.min(1, this.camera.aspect);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(direction.normalize(), 0.9 * far);
    this.controls.update();
    this.draw();
  }

  /** As a view that was there before. */
  lookAs(other) {
    this.touched = true;
    this.controls.target.copy(other.controls.target);
    this.camera.position.copy(other.camera.position);
    this.controls.update();
  }

  /** Once in the next frame, however often it is asked for. */
  draw() {
    if (this.waiting || this.seen === false) return;
    this.waiting = requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    this.renderer.render(this.scene, this.camera);
  }

  resize(width, height) {
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** Longer trajectories by name; a surface or cloud replaces the one of its id; the vehicle moves. */
  append(patch) {
    for (const one of patch.trajectories ?? []) {
      this.trajectories.find((t) => t.data.name === one.name)?.append(one.points, one.value, one.replace);
    }
    if (patch.pose) this.move(patch.pose);
    for (const one of patch.surfaces ?? []) this.replace(new Surface(one, this.data.labels ?? []));
    for (const one of patch.clouds ?? []) this.replace(new Cloud(one, this.data.labels ?? []));
    if (!(performance.now() - this.looked < kLookAnew)) this.lookAnew();
    this.draw();
  }

  replace(next) {
    const i = this.surfaces.findIndex((s) => s.data.id === next.data.id);
    if (i >= 0) {
      next.object.visible = this.surfaces[i].object.visible;
      this.scene.remove(this.surfaces[i].object);
      this.surfaces[i].geometry.dispose();
      this.surfaces[i].object.material.dispose();
      this.surfaces[i] = next;
    } else {
      this.surfaces.push(next);
      this.makeBar();
    }
    if (next instanceof Surface) this.side(next);
    next.colour(this.way?.value ?? this.ways()[0], [this.box.min.z, this.box.max.z]);
    this.scene.add(next.object);
  }

  /** A scene that has grown: its bounds, its grid and, unless somebody has turned it, the whole of it. */
  lookAnew() {
    this.looked = performance.now();
    const before = this.box;
    this.findBounds();
    const size = before.getSize(new Vector3()).length();
    const moved = Math.max(before.min.distanceTo(this.box.min), before.max.distanceTo(this.box.max));
    if (moved > 0.05 * size) {
      this.addGrid();
      this.colour(this.way?.value ?? this.ways()[0]);
      if (!this.touched) this.look(new Vector3(...(this.from ?? [0.8, -1.2, 0.9])));
    } else {
      this.makeLegend(this.way?.value ?? this.ways()[0]);
    }
  }

  /** How many different colours a drawing has: 1 is an empty one. */
  colours() {
    this.drawNow();
    const gl = this.renderer.getContext();
    const { drawingBufferWidth: w, drawingBufferHeight: h } = gl;
    const pixels = new Uint8Array(w * h * 4);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return new Set(new Uint32Array(pixels.buffer)).size;
  }
}
