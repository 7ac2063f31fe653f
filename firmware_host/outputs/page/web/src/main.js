// The page: one document in, sections of plots and tables out; later documents are appended to it.
// The document is described in docs/report.md.

import 'uplot/dist/uPlot.min.css';
import './style.css';
import { sharedBounds } from './columns.js';
import { Drawing } from './drawing.js';
import { HistogramPlot } from './histogram_plot.js';
import { ImagePanel } from './image_panel.js';
import { LiveView } from './live.js';
import { PlanPlot } from './plan_plot.js';
import { Playback } from './playback.js';
import { SceneView } from './scene.js';
import { element, eventsTable, tableElement } from './tables.js';
import { TimePlot, forget, setEnd } from './time_plot.js';
import { Timeline } from './timeline.js';

const kFormat = 1;
const kMostEvents = 1000; // of a run that goes on
const kinds = { time: TimePlot, plan: PlanPlot, histogram: HistogramPlot, drawing: Drawing };

class Run {
  constructor(run, width) {
    this.run = run;
    // Runs of one log share the cursor and the zoom.
    this.key = `time${run.first_image_ns}`;
    this.plots = new Map();
    this.width = width;
    this.isFlight = run.first_image_ns != null; // else a calibration
    this.run.health ??= [];
    this.run.events ??= [];
    this.stale = new Set(); // plots that have more than they show
    this.hidden = new Set();
  }

  header(letter) {
    const head = element('div', null, 'run');
    head.append(element('h2', `${letter}${this.run.name}`));
    if (this.run.verdict) {
      const verdict = element('p', this.run.verdict.text, 'verdict');
      verdict.dataset.verdict = this.run.verdict.kind;
      head.append(verdict);
    }
    for (const line of this.run.words ?? []) head.append(element('p', line, 'word'));
    for (const missing of this.run.missing ?? []) {
      head.append(element('p', `${missing.file}: ${missing.what}`, 'missing'));
    }
    return head;
  }

  timeline(host) {
    this.line = new Timeline(this.run, host, this.width, this.key);
  }

  plot(plot, host, width, shared) {
    const figure = element('figure');
    figure.dataset.plot = plot.id;
    figure.append(element('figcaption', plot.title + (plot.y_label && plot.kind === 'time' ? ` [${plot.y_label}]` : '')));
    host.append(figure);
    const height = plot.kind === 'plan' ? 420 : 230;
    const made = new kinds[plot.kind](plot, figure, width, height, this.key, shared);
    if (plot.note) figure.append(element('p', plot.note, 'note'));
    this.plots.set(plot.id, made);
    figure.plotId = plot.id;
    (this.figures ??= []).push(figure);
  }

  images(host, width = this.width) {
    const { cameras } = this.run;
    if (cameras?.length) this.panel = new ImagePanel(host, width, cameras);
  }

  /** Images beside the 3D view, under the slider that chooses their moment. */
  moments(host) {
    if (!this.run.playback?.count) {
      host.className = 'scene';
      this.sceneHost = host;
      return;
    }
    // Of one run on top of the page, where it stays in sight.
    this.playback = new Playback(this);
    if (report.runs.length > 1) host.append(this.playback.bar);
    else document.getElementById('report').prepend(this.playback.bar);
    const pair = element('div', null, 'moment');
    const images = element('div');
    this.sceneHost = element('div', null, 'scene');
    const beside = this.run.cameras?.length > 0 && this.width > 900;
    const imageWidth = Math.floor(this.width * (beside ? 0.6 : 1));
    this.sceneWidth = beside ? this.width - imageWidth - 24 : this.width;
    if (beside) images.style.width = `${imageWidth}px`;
    this.sceneHost.style.width = `${this.sceneWidth}px`;
    this.images(images, imageWidth);
    pair.append(images, this.sceneHost);
    host.append(pair);
  }

  /** On all plots and in the 3D view; `pose`: null where there is none. */
  showMoment(t, pose) {
    this.line?.moment(t);
    for (const plot of this.plots.values()) plot.moment?.(t, pose);
    this.view?.showMoment(t, pose);
  }

  /** A click on a plot over time chooses the moment there. */
  followClicks() {
    const plots = [this.line, ...this.plots.values()].filter((one) => one?.atClick);
    for (const plot of plots) plot.atClick((t) => this.playback.goTo(t));
  }

  tables(host) {
    this.tablesHost = host;
    if (this.isFlight) host.append(eventsTable(this.run));
    for (const table of this.run.tables ?? []) host.append(tableElement(table));
  }

  scene(host) {
    const data = this.run.scene;
    if (!data || data.trajectories.length + data.surfaces.length === 0) {
      host.append(element('p', 'No trajectory and no surface to show.', 'note'));
      return;
    }
    if (!SceneView.renderer()) {
      host.append(element('p', 'This browser gives no WebGL: the 3D view is left out.', 'note'));
      return;
    }
    const width = this.sceneWidth ?? this.width;
    this.view = new SceneView(data, host, width, Math.min(560, Math.round(width * 0.6)));
  }

  append(patch) {
    if (patch.health) this.run.health = patch.health;
    if (patch.events) {
      this.run.events.push(...patch.events);
      this.run.events.splice(0, this.run.events.length - kMostEvents);
      this.replaceTable(eventsTable(this.run));
    }
    if (patch.duration != null) {
      this.run.duration = patch.duration;
      if (!patch.health && this.run.health.length) this.run.health.at(-1).to = patch.duration;
      if (patch.live) setEnd(this.key, patch.duration);
    }
    this.moved ||= patch.health || patch.events || patch.duration != null;
    for (const plot of patch.plots ?? []) {
      this.plots.get(plot.id)?.append(plot.series, plot.replace);
      this.stale.add(plot.id);
    }
    for (const table of patch.tables ?? []) this.replaceTable(tableElement(table));
    if (patch.scene) this.view?.append(patch.scene);
    this.refresh();
  }

  refreshAll() {
    for (const id of this.plots.keys()) this.stale.add(id);
    this.moved = true;
    this.refresh();
  }

  replaceTable(next) {
    const old = this.tablesHost?.querySelector(`[data-table="${CSS.escape(next.dataset.table)}"]`);
    if (old) next.open = old.open;
    old ? old.replaceWith(next) : this.tablesHost?.append(next);
  }

  /** Draws what is in sight, once in the next frame; the rest when it comes into sight. */
  refresh() {
    if (!this.watch) {
      this.watch = new IntersectionObserver((entries) => {
        for (const { target, isIntersecting } of entries) {
          if (isIntersecting) this.hidden.delete(target.plotId);
          else this.hidden.add(target.plotId);
        }
        this.refresh();
      });
      for (const figure of this.figures ?? []) this.watch.observe(figure);
    }
    this.waiting ||= requestAnimationFrame(() => {
      this.waiting = 0;
      if (this.moved) this.line?.refresh();
      this.moved = false;
      for (const id of [...this.stale].filter((one) => !this.hidden.has(one))) {
        this.plots.get(id)?.refresh();
        this.stale.delete(id);
      }
    });
  }

  /** Gives back what a page that shows one run after the other would gather. */
  dispose() {
    this.watch?.disconnect();
    cancelAnimationFrame(this.waiting);
    this.line?.dispose();
    for (const plot of this.plots.values()) plot.dispose();
    this.view?.dispose();
    this.panel?.dispose();
    this.playback?.dispose();
    forget(this.key);
  }
}

const report = {
  document: null,
  runs: [],
  ready: false,

  /** Shows a whole document. */
  load(json) {
    if (json.format !== kFormat) throw new Error(`this page shows format ${kFormat}, the document has ${json.format}`);
    this.document = json;
    const host = document.getElementById('report');
    const before = this.runs[0]?.view;
    for (const run of this.runs) run.dispose();
    host.replaceChildren();
    const beside = json.runs.length > 1;
    document.title = `swiftlet: ${json.runs.map((r) => r.name).join(' and ')}`;
    // Without the host's own margins.
    const room = Math.min(host.clientWidth - 40, 1800);
    const width = Math.floor((room - (beside ? 24 : 0)) / json.runs.length);
    this.runs = json.runs.map((run) => new Run(run, width));
    if (json.live) for (const run of this.runs) setEnd(run.key, run.run.duration);
    // A row of the page: one cell for each run.
    const row = (title, fill) => {
      if (title) host.append(element('h3', title));
      const cells = element('div', null, beside ? 'beside' : 'alone');
      this.runs.forEach((run, i) => {
        const cell = element('div');
        cells.append(cell);
        fill(run, cell, i);
      });
      host.append(cells);
    };
    row('', (run, cell, i) => cell.append(run.header(beside ? `${'AB'[i]}: ` : '')));
    if (beside) {
      host.append(element('h3', 'Differences'));
      if (!json.differences?.length) host.append(element('p', 'None.', 'note'));
      for (const table of json.differences ?? []) host.append(tableElement(table));
    }
    const playing = json.runs.some((run) => run.playback?.count);
    if (playing) row('Moments', (run, cell) => run.moments(cell));
    const flights = this.runs.every((run) => run.isFlight);
    if (flights) row('Health and events', (run, cell) => run.timeline(cell));
    if (!playing && json.runs.some((run) => run.cameras?.length)) row('Cameras', (run, cell) => run.images(cell));
    const groups = [...new Set(json.runs.flatMap((run) => run.plots.map((plot) => plot.group)))];
    const scenes = () => !playing && json.runs.some((run) => run.scene) && row('3D view', (run, cell) => { cell.className = 'scene'; run.sceneHost = cell; });
    if (!groups.includes('Trajectory')) scenes();
    for (const group of groups) {
      if (beside) {
        // A row for each plot, with one scale: what only one run has leaves the other's place empty.
        host.append(element('h3', group));
        const ids = new Set(json.runs.flatMap((run) => run.plots.filter((p) => p.group === group).map((p) => p.id)));
        for (const id of ids) {
          const plots = json.runs.map((run) => run.plots.find((p) => p.id === id));
          const shared = sharedBounds(plots.filter(Boolean));
          row('', (run, cell, i) => {
            if (plots[i]) run.plot(plots[i], cell, width, shared);
            else cell.append(element('p', `${plots[1 - i].title}: only ${'BA'[i]} has it`, 'note'));
          });
        }
        if (group === 'Trajectory') scenes();
        continue;
      }
      const across = width > 1300 ? 3 : width > 760 ? 2 : 1;
      row(group, (run, cell) => {
        cell.className = 'plots';
        const wide = group === 'Trajectory' ? Math.min(across, 2) : across;
        for (const plot of run.run.plots.filter((p) => p.group === group)) {
          run.plot(plot, cell, Math.floor((width - 14 * (wide - 1)) / wide));
        }
      });
      if (group === 'Trajectory') scenes();
    }
    row('Tables', (run, cell) => run.tables(cell));
    host.append(element('p', json.program, 'note'));
    // The plots are to be seen before the surfaces are made.
    this.done = new Promise((resolve) => {
      requestAnimationFrame(() => setTimeout(() => {
        this.times = { plots: performance.now() };
        for (const run of this.runs) {
          if (run.sceneHost) run.scene(run.sceneHost);
          if (before?.touched) run.view?.lookAs(before);
          run.view?.drawNow();
          if (run.playback) {
            run.followClicks();
            run.playback.go(0);
          }
        }
        this.times.scene = performance.now();
        this.ready = true;
        resolve();
      }, 0));
    });
    return this.done;
  },

  /** Adds to what is shown: {"run", "health", "events", "duration", "plots", "tables", "scene"}. */
  append(patch) {
    this.runs[patch.run ?? 0]?.append(patch);
  },

  /** The cameras' images of one instant (image_panel.js). */
  showImages(message) {
    this.runs[message.run ?? 0]?.panel?.show(message);
  },

  /** What a test asks for: how much each plot shows. */
  figures() {
    return this.runs.map((run) => ({
      name: run.run.name,
      timeline: run.line?.count() ?? 0,
      plots: Object.fromEntries([...run.plots].map(([id, plot]) => [id, plot.count()])),
      sceneColours: run.view ? run.view.colours() : 0,
      images: run.panel ? { shown: run.panel.shown, ...run.panel.count() } : null,
      moments: run.playback?.t.length ?? 0,
    }));
  },
};

window.swiftletReport = report;
const embedded = document.getElementById('report-document');
if (embedded) report.load(JSON.parse(embedded.textContent));
const live = document.getElementById('swiftlet-live');
if (live) report.live = new LiveView(report, live.content + location.search);
