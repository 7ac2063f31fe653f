// Moments of a run that is over: a slider and keys choose one, and images, 3D view and plots show it. The moments are
// described in docs/report.md: those of a report are in its document, a server is asked for the others.

import { bytes, floats } from './columns.js';
import { element } from './tables.js';

const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 5];

export class Playback {
  constructor(run) {
    this.run = run;
    const { playback } = run.run;
    this.playback = playback;
    this.t = floats(playback.t);
    this.poses = floats(playback.poses);
    this.keyframes = bytes(playback.keyframes);
    this.index = -1;
    this.speed = 1;
    this.bar = element('div', null, 'live playback');
    this.makeBar();
    this.pressed = (event) => this.press(event);
    document.addEventListener('keydown', this.pressed);
  }

  makeBar() {
    const button = (text, title, act) => {
      const made = element('button', text);
      made.title = title;
      made.addEventListener('click', act);
      this.bar.append(made);
      return made;
    };
    button('\u25c0', 'one image back (left; with Shift to a keyframe)', () => this.step(-1));
    this.playButton = button('play', 'play, pause (space)', () => this.toggle());
    button('\u25b6', 'one image on (right; with Shift to a keyframe)', () => this.step(1));
    this.slider = element('input');
    this.slider.type = 'range';
    this.slider.min = 0;
    this.slider.max = this.t.length - 1;
    this.slider.addEventListener('input', () => {
      this.pause();
      this.go(Number(this.slider.value));
    });
    this.where = element('span', '', 'time');
    const speed = element('select');
    for (const times of kSpeeds) {
      const option = element('option', `${times} x`);
      option.value = times;
      option.selected = times === 1;
      speed.append(option);
    }
    speed.addEventListener('change', () => { this.speed = Number(speed.value); });
    const label = element('label', 'speed ');
    label.append(speed);
    this.bar.append(this.slider, this.where, label);
  }

  /** Whether keys have a meaning of their own there. */
  hasKeys({ tagName, type }) {
    return tagName === 'SELECT' || tagName === 'INPUT' && type !== 'range';
  }

  press(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || this.hasKeys(event.target)) return;
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (way) event.shiftKey ? this.toKeyframe(way) : this.step(way);
    else if (event.key === ' ') this.toggle();
    else return;
    event.preventDefault();
  }

  step(way) {
    this.pause();
    this.go(this.index + way);
  }

  toKeyframe(way) {
    this.pause();
    for (let i = this.index + way; i >= 0 && i < this.t.length; i += way) {
      if (this.keyframes[i]) return this.go(i);
    }
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.index >= this.t.length - 1) this.go(0);
    this.playButton.textContent = 'pause';
    let before = performance.now();
    let t = this.t[this.index];
    const turn = (now) => {
      t += this.speed * (now - before) / 1000;
      before = now;
      this.go(this.indexAt(t));
      if (this.index >= this.t.length - 1) this.pause();
      else this.playing = requestAnimationFrame(turn);
    };
    this.playing = requestAnimationFrame(turn);
  }

  pause() {
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    this.playButton.textContent = 'play';
  }

  /** The last moment not after `t`. */
  indexAt(t) {
    let low = 0;
    let high = this.t.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.t[middle] <= t) low = middle;
      else high = middle;
    }
    return low;
  }

  /** The moment nearest to where somebody points. */
  goTo(t) {
    this.pause();
    const i = this.indexAt(t);
    this.go(i + 1 < this.t.length && this.t[i + 1] - t < t - this.t[i] ? i + 1 : i);
  }

  go(wanted) {
    const i = Math.max(0, Math.min(this.t.length - 1, wanted));
    if (i === this.index) return;
    this.index = i;
    this.slider.value = i;
    const pose = this.poses.subarray(7 * i, 7 * i + 7);
    const known = Number.isFinite(pose[0]);
    this.where.textContent = `${this.t[i].toFixed(3)} s, ${i + 1} of ${this.t.length}`
      + `${this.keyframes[i] ? ', keyframe' : ''}${known ? '' : ', no pose'}`;
    this.run.showMoment(this.t[i], known ? pose : null);
    this.ask();
  }

  /** One request at a time: while one is answered, only the newest moment waits. */
  async ask() {
    if (this.asking) return;
    this.asking = true;
    while (!this.disposed && this.asked !== this.index) {
      this.asked = this.index;
      try {
        const message = await this.message(this.asked);
        if (this.disposed) return;
        this.fault = '';
        if (message.cameras.length) await this.run.panel?.show(message);
        if (message.scene) this.run.view?.append(message.scene);
      } catch (error) {
        this.fault = String(error.message ?? error);
        this.where.textContent += `: ${this.fault}`;
      }
    }
    this.asking = false;
  }

  async message(i) {
    const { messages, source } = this.playback;
    if (messages) return messages[i];
    const query = new URLSearchParams(window.location.search); // a token, where there is one
    query.set('i', i);
    const answer = await fetch(`${source}?${query}`);
    if (!answer.ok) throw new Error(`the images cannot be had (${answer.status})`);
    return answer.json();
  }

  dispose() {
    this.disposed = true;
    this.pause();
    document.removeEventListener('keydown', this.pressed);
  }
}
