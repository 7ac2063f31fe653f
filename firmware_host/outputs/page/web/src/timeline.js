// Health as spans over time and, in a lane for each name, the events.

import uPlot from 'uplot';
import * as colours from './colours.js';
import { Moment } from './moment.js';
import { follow, kZoomDrag, setDataOf, spreadZoom, takeClicks, unfollow, zoomBy } from './time_plot.js';

const kLane = 20; // px

export class Timeline {
  constructor(run, host, width, key) {
    this.run = run;
    this.host = host;
    this.tip = document.createElement('div');
    this.tip.className = 'tip';
    this.key = key;
    this.build(width);
  }

  lanes() {
    return ['health', ...new Set(this.run.events.map((e) => e.name))];
  }

  build(width) {
    const lanes = this.lanes();
    const middle = lanes.map((_, i) => lanes.length - i - 0.5);
    this.names = lanes;
    if (this.plot) {
      unfollow(this.key, this.plot);
      this.plot.destroy();
    }
    this.plot = new uPlot(
      {
        width,
        height: kLane * lanes.length + 52,
        legend: { show: false },
        scales: { x: { time: false, range: (_, low, high) => [low, high] }, y: { range: [0, lanes.length] } },
        axes: [
          { label: 'time [s]', size: 34, labelSize: 18, font: '11px system-ui', labelFont: '11px system-ui' },
          { size: 120, font: '11px system-ui', splits: () => middle, values: () => lanes, grid: { show: false }, ticks: { show: false } },
        ],
        series: [{}, { paths: () => null, points: { show: false } }],
        cursor: { sync: { key: this.key }, y: false, points: { show: false }, drag: kZoomDrag, bind: zoomBy() },
        hooks: { draw: [(u) => this.draw(u)], setCursor: [(u) => this.point(u)], setScale: [spreadZoom(this.key)] },
      },
      this.data(),
      this.host,
    );
    this.plot.over.append(this.tip);
    follow(this.key, this.plot);
  }

  data() {
    const end = Math.max(this.run.duration, ...this.run.events.map((e) => e.t), 1e-3);
    return [[Math.min(0, ...this.run.events.map((e) => e.t)), end], [0, 0]];
  }

  top(u, lane) {
    return u.valToPos(this.names.length - lane, 'y', true) + 3 * devicePixelRatio;
  }

  draw(u) {
    const { ctx, bbox } = u;
    const height = (bbox.height / this.names.length) - 6 * devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const span of this.run.health) {
      const left = u.valToPos(span.from, 'x', true);
      ctx.fillStyle = colours.health[span.health] ?? '#888';
      ctx.fillRect(left, this.top(u, 0), Math.max(u.valToPos(span.to, 'x', true) - left, 2), height);
    }
    for (const event of this.run.events) {
      const lane = this.names.indexOf(event.name);
      ctx.fillStyle = colours.lines[lane % colours.lines.length];
      const x = u.valToPos(event.t, 'x', true);
      ctx.fillRect(x - devicePixelRatio, this.top(u, lane), 3 * devicePixelRatio, height);
    }
    ctx.restore();
  }

  point(u) {
    const { left, top } = u.cursor;
    this.tip.style.display = 'none';
    if (left == null || left < 0 || top < 0) return;
    const lane = Math.floor((top / u.over.clientHeight) * this.names.length);
    const t = u.posToVal(left, 'x');
    let text = '';
    if (lane === 0) {
      const span = this.run.health.find((s) => t >= s.from && t <= s.to);
      if (span) text = `${span.health}, ${span.from.toFixed(2)} to ${span.to.toFixed(2)} s${span.epoch == null ? '' : `, epoch ${span.epoch}`}`;
    } else {
      let best = 6;
      for (const event of this.run.events) {
        const off = Math.abs(u.valToPos(event.t, 'x') - left);
        if (event.name !== this.names[lane] || off > best) continue;
        best = off;
        text = `${event.t.toFixed(3)} s: ${event.name} ${event.text}`;
      }
    }
    if (!text) return;
    this.tip.textContent = text;
    this.tip.style.display = 'block';
    this.tip.style.left = `${Math.min(left + 8, u.over.clientWidth - 260)}px`;
    this.tip.style.top = `${top + 12}px`;
  }

  moment(t) {
    (this.mark ??= new Moment(this.plot, 'moment-line')).show(t);
  }

  atClick(take) {
    takeClicks(this.plot, take);
  }

  count() {
    return this.run.health.length + this.run.events.length;
  }

  refresh() {
    if (this.lanes().length !== this.names.length) this.build(this.plot.width);
    else setDataOf(this.plot, this.key, this.data());
  }

  dispose() {
    unfollow(this.key, this.plot);
    this.plot.destroy();
  }

  resize(width) {
    this.plot.setSize({ width, height: this.plot.height });
  }
}
