// A run that goes on: the stream of documents and patches, and a bar that says how things are.
// The stream is described in docs/view.md.

import { setWindow } from './time_plot.js';
import { element } from './tables.js';

const kSilent = 3000; // ms without a message: said
const kDead = 8000; // ms: connected anew
const kFirstRetry = 1000;
const kMostRetry = 10000;

const number = (value, digits = 2) => (Number.isFinite(value) ? value.toFixed(digits) : '');

export class LiveView {
  constructor(report, address) {
    this.report = report;
    this.address = address;
    this.state = 'connecting'; // live, silent, ended, lost
    this.documents = 0;
    this.patches = 0;
    this.bar = element('div', null, 'live');
    document.querySelector('header').textContent = 'swiftlet live';
    document.querySelector('header').after(this.bar);
    this.makeBar();
    this.retry = kFirstRetry;
    this.connect();
    setInterval(() => this.watch(), 500);
  }

  makeBar() {
    this.parts = {};
    for (const name of ['state', 'health', 'time', 'position', 'speed', 'arming']) {
      this.parts[name] = element('span', '', name);
      this.bar.append(this.parts[name]);
    }
    const select = element('select');
    for (const [text, seconds] of [['whole run', 0], ['last 10 s', 10], ['last minute', 60], ['last 10 minutes', 600]]) {
      const option = element('option', text);
      option.value = seconds;
      select.append(option);
    }
    select.addEventListener('change', () => {
      setWindow(Number(select.value));
      for (const run of this.report.runs) run.refreshAll();
    });
    const label = element('label', 'plots show ');
    label.append(select);
    this.bar.append(label);
    this.show();
  }

  connect() {
    clearTimeout(this.timer);
    this.source?.close();
    this.sequence = null;
    this.heard = Date.now();
    const source = new EventSource(this.address);
    this.source = source;
    this.work = Promise.resolve();
    // One after the other: a document takes its time.
    const take = (name, handle) => source.addEventListener(name, (event) => {
      this.heard = Date.now();
      const data = JSON.parse(event.data);
      this.work = this.work.then(() => source === this.source && handle(data));
    });
    take('document', (json) => this.takeDocument(json));
    take('patch', (patch) => this.takePatch(patch));
    take('images', (images) => this.sequence != null && this.report.showImages(images));
    take('end', () => {
      source.close();
      this.say('ended');
      this.again();
    });
    source.addEventListener('error', () => {
      source.close();
      this.work = this.work.then(() => {
        if (source !== this.source || this.state === 'ended' && this.sequence != null) return;
        if (this.state !== 'ended') this.say('lost');
        this.again();
      });
    });
  }

  /** Later: a run that has ended may be followed by another. */
  again() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.connect(), this.retry);
    this.retry = Math.min(2 * this.retry, kMostRetry);
  }

  async takeDocument(json) {
    this.sequence = json.sequence;
    this.retry = kFirstRetry;
    this.documents += 1;
    await this.report.load(json);
    this.now = json.live;
    this.say('live');
  }

  takePatch(patch) {
    if (this.sequence == null) return;
    if (patch.sequence <= this.sequence) return;
    if (patch.sequence !== this.sequence + 1) {
      this.connect();
      return;
    }
    this.sequence = patch.sequence;
    this.patches += 1;
    this.report.append(patch);
    this.now = patch.live;
    this.say('live');
  }

  watch() {
    const quiet = Date.now() - this.heard;
    if (this.state === 'ended' || this.state === 'lost') return;
    if (quiet > kDead) {
      this.say('lost');
      this.connect();
    } else if (quiet > kSilent && this.state === 'live') {
      this.say('silent');
    }
  }

  say(state) {
    this.state = state;
    this.show();
  }

  show() {
    const words = {
      connecting: 'connecting ...',
      live: 'live',
      silent: 'live, but nothing has come for some seconds',
      ended: 'the run has ended; waiting for another',
      lost: 'connection lost; trying again',
    };
    const now = this.now ?? {};
    // The run's own silence: the server goes on.
    const stuck = this.state === 'live' && now.silent_s > 1;
    this.bar.dataset.state = stuck ? 'silent' : this.state;
    this.parts.state.textContent = stuck ? `no state for ${number(now.silent_s, 0)} s` : words[this.state];
    // Health and readiness to arm hold only as long as the run is heard.
    const said = this.state === 'live' ? now : {};
    this.parts.health.textContent = said.health ? `${said.health}${said.epoch ? `, epoch ${said.epoch}` : ''}` : '';
    const troubles = said.unsupervised ? [said.unsupervised]
      : (said.troubles ?? []).map((t) => `${t.member} is ${t.condition}: ${t.text}`);
    if (troubles.length > 0) this.parts.health.textContent += `: ${troubles.join('; ')}`;
    if (said.waiting_for) this.parts.health.textContent += `: waits for ${said.waiting_for}`;
    this.parts.health.dataset.health = said.health ?? '';
    this.parts.time.textContent = now.t == null ? '' : `${number(now.t, 1)} s`;
    this.parts.position.textContent = now.position ? `at ${now.position.map((v) => number(v)).join(' ')} m` : '';
    this.parts.speed.textContent = now.speed == null ? '' : `${number(now.speed)} m/s${now.at_rest ? ', at rest' : ''}`;
    const missing = said.arming?.missing ?? [];
    this.parts.arming.textContent = !said.arming ? '' : said.arming.ready ? 'ready to arm'
      : `not ready to arm: ${[...new Set(missing.map((m) => m.condition))].join(', ')}`;
    this.parts.arming.title = missing.map((m) => `${m.condition}: ${m.what}; ${m.remedy}`).join('\n');
    this.parts.arming.dataset.ready = said.arming ? String(said.arming.ready) : '';
  }
}
