'use strict';
// Plots over time, all with one time axis; a line each for what is told, one style a meaning.

const DEGREES = 180 / Math.PI;
const PLOTS = [
  { title: 'Speed', unit: 'm/s', floor: 0, lines: [{ name: 'speed_mps', label: 'ego', style: 'bold' }] },
  { title: 'Acceleration', unit: 'm/s²', zero: true, filled: true, lines: [
    { name: 'acceleration_mps2', label: 'realised', style: 'faint' },
    { name: 'nominal_acceleration_mps2', label: 'nominal', style: 'dashed' },
    { name: 'safe_acceleration_mps2', label: 'safe', style: 'bold' }] },
  { title: 'Steering', unit: 'deg', zero: true, scale: DEGREES, filled: true, lines: [
    { name: 'steering_rad', label: 'realised', style: 'faint' },
    { name: 'nominal_steering_rad', label: 'nominal', style: 'dashed' },
    { name: 'safe_steering_rad', label: 'safe', style: 'bold' }] },
  { title: 'Uncertainty', unit: 'reward', floor: 0, limits: true, lines: [
    { name: 'sigma_ale', label: 'ale', style: 'faint' }, { name: 'sigma_epi', label: 'epi', style: 'dashed' },
    { name: 'sigma', label: 'sigma', style: 'bold' }] },
  { title: 'Least h', unit: 'm²', zero: true, cut: 60, lines: [{ name: 'least_h_m2', label: 'h', style: 'bold' }] },
  { title: 'Slack', unit: 'delta(sigma)', zero: true, usual: 0, lines: [
    { name: 'slack', label: 'delta', style: 'bold' }] },
  { title: 'Smallest gap', unit: 'm', floor: 0, cut: 20, lines: [{ name: 'gap_m', label: 'gap', style: 'bold' }] },
  { title: 'Friction', unit: 'mu', floor: 0, usual: 0.9, lines: [
    { name: 'true_friction', label: 'true', style: 'dashed' }, { name: 'friction', label: 'identified', style: 'bold' }] },
  { title: 'Delay', unit: 's', floor: 0, usual: 0, lines: [
    { name: 'true_delay_s', label: 'true', style: 'dashed' }, { name: 'delay_s', label: 'identified', style: 'bold' }] },
];
const LEVELS = { '': 0, nominal: 0.15, solved: 0.55 };
const LEFT = 44, RIGHT = 8, TOP = 19, BOTTOM = 5, TIGHT = 420;

function plotsOf(runs) {
  const known = (plot, run) => plot.lines.some((line) => {
    const values = run.series[line.name].filter((v) => v !== null);
    return plot.usual === undefined ? values.length > 0 : values.some((v) => Math.abs(v - plot.usual) > 1e-9);
  });
  return PLOTS.filter((plot) => runs.some((run) => known(plot, run)));
}

// The same for both runs, so that they compare.
function rangeOf(plot, runs) {
  const scale = plot.scale || 1;
  let low = Infinity, high = -Infinity;
  const reach = (v) => { low = Math.min(low, v); high = Math.max(high, v); };
  for (const run of runs) {
    for (const line of plot.lines) for (const v of run.series[line.name]) if (v !== null) reach(v * scale);
    if (plot.limits && run.sigma_high !== null) reach(run.sigma_high);
  }
  if (plot.zero) { low = Math.min(low, 0); high = Math.max(high, 0); }
  if (plot.floor !== undefined) low = plot.floor;
  const cut = plot.cut !== undefined && high > plot.cut;
  if (cut) { high = plot.cut; low = Math.max(low, -plot.cut); }
  if (high - low < 1e-6) high = low + 1;
  const more = 0.06 * (high - low);
  const room = plot.limits ? 5 * more : more;  // a limit's name stands above its line
  return { low: plot.floor !== undefined ? low : low - more, high: high + room, cut };
}

class PlotView {
  constructor(holder, run, plot, go) {
    this.run = run;
    this.plot = plot;
    this.canvas = document.createElement('canvas');
    this.canvas.className = plot.status ? 'plot low' : 'plot';
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label', `${plot.title} over time`);
    holder.append(this.canvas);
    this.range = plot.status ? { low: 0, high: 1 } : rangeOf(plot, RUNS);
    const seek = (event) => {
      const box = this.canvas.getBoundingClientRect();
      go(Math.round(((event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT)) * (FRAMES - 1)));
    };
    this.canvas.addEventListener('pointerdown', (event) => { this.canvas.setPointerCapture(event.pointerId); seek(event); });
    this.canvas.addEventListener('pointermove', (event) => { if (event.buttons) seek(event); });
  }

  // Everything but the cursor is kept as a picture until size or theme change.
  draw(frame, share) {
    const ratio = fitCanvas(this.canvas), key = `${this.canvas.width} ${this.canvas.height} ${isDark()}`;
    this.colours = themed();
    this.width = this.canvas.width / ratio; this.height = this.canvas.height / ratio;
    if (key !== this.key) {
      this.key = key;
      this.still = document.createElement('canvas');
      this.still.width = this.canvas.width; this.still.height = this.canvas.height;
      const c = this.ctx = this.still.getContext('2d');
      c.scale(ratio, ratio);
      this.drawStill();
    }
    const c = this.ctx = this.canvas.getContext('2d');
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.still, 0, 0);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const k = Math.min(frame, this.run.frames - 1);
    const x = this.x(Math.min(frame + share, this.run.frames - 1));
    c.strokeStyle = this.colours.page_ink; c.lineWidth = 1.5;
    c.beginPath(); c.moveTo(x, TOP - 2); c.lineTo(x, this.height); c.stroke();
    this.drawTitle(k, x);
  }

  x(frame) { return LEFT + (frame / Math.max(FRAMES - 1, 1)) * (this.width - LEFT - RIGHT); }

  y(value) {
    const { low, high } = this.range, v = Math.min(Math.max(value, low), high);
    return this.height - BOTTOM - ((v - low) / (high - low)) * (this.height - TOP - BOTTOM);
  }

  drawStill() {
    const c = this.ctx;
    c.font = '11px system-ui, "DejaVu Sans", sans-serif';
    this.drawEventLines();
    if (this.plot.status) { this.drawStatus(); return; }
    this.drawAxis();
    if (this.plot.filled) this.drawCorrection();
    for (const line of this.plot.lines) this.drawLine(line);
  }

  drawAxis() {
    const c = this.ctx, { low, high } = this.range, step = niceStep((high - low) / 3);
    c.fillStyle = this.colours.page_faint; c.textAlign = 'right'; c.textBaseline = 'middle';
    c.lineWidth = 1;
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9; v += step) {
      const value = Math.abs(v) < 1e-9 ? 0 : v;
      c.strokeStyle = value === 0 ? this.colours.page_faint : this.colours.page_line;
      this.rule(this.y(value));
      c.fillText(String(+value.toFixed(6)), LEFT - 5, this.y(value));
    }
    if (!this.plot.limits || this.run.sigma_low === null) return;
    for (const [name, value] of [['sigma_l', this.run.sigma_low], ['sigma_h', this.run.sigma_high]]) {
      c.strokeStyle = this.colours.event;
      c.setLineDash(name === 'sigma_h' ? [] : [5, 3]);
      this.rule(this.y(value));
      c.setLineDash([]);
      c.fillStyle = this.colours.page_ink;
      c.textBaseline = name === 'sigma_h' ? 'bottom' : 'top';
      c.fillText(name, this.width - RIGHT - 2, this.y(value));
    }
  }

  rule(y) {
    const c = this.ctx;
    c.beginPath(); c.moveTo(LEFT, y); c.lineTo(this.width - RIGHT, y); c.stroke();
  }

  drawEventLines() {
    const c = this.ctx;
    for (const { at, number } of eventFrames(this.run)) {
      const x = this.x(at);
      c.strokeStyle = this.colours.event; c.lineWidth = 1; c.setLineDash([2, 3]);
      c.beginPath(); c.moveTo(x, TOP - 4); c.lineTo(x, this.height); c.stroke();
      c.setLineDash([]);
      c.fillStyle = this.colours.page_ink; c.textAlign = 'left'; c.textBaseline = 'bottom';
      if (this.plot === PLOTS[0]) c.fillText(`(${number})`, x + 2, this.height - 1);
    }
  }

  // What lies between nominal and safe is what the correction did.
  drawCorrection() {
    const c = this.ctx, [, nominal, safe] = this.plot.lines.map((line) => this.run.series[line.name]);
    const scale = this.plot.scale || 1;
    if (nominal.every((v, k) => Math.abs(v - safe[k]) < 1e-4)) return;
    c.beginPath();
    nominal.forEach((v, k) => c.lineTo(this.x(k), this.y(v * scale)));
    for (let k = safe.length - 1; k >= 0; k--) c.lineTo(this.x(k), this.y(safe[k] * scale));
    c.closePath();
    c.globalAlpha = 0.35; c.fillStyle = this.colours.active; c.fill(); c.globalAlpha = 1;
  }

  drawLine({ name, style }) {
    const c = this.ctx, scale = this.plot.scale || 1;
    c.strokeStyle = style === 'faint' ? this.colours.page_faint : this.colours.page_ink;
    c.lineWidth = style === 'bold' ? 1.8 : 1.1;
    c.setLineDash(style === 'dashed' ? [4, 3] : []);
    c.globalAlpha = style === 'faint' ? 0.75 : 1;
    c.beginPath();
    let down = false;
    this.run.series[name].forEach((v, k) => {
      if (v === null) { down = false; return; }
      if (down) c.lineTo(this.x(k), this.y(v * scale)); else c.moveTo(this.x(k), this.y(v * scale));
      down = true;
    });
    c.stroke();
    c.setLineDash([]); c.globalAlpha = 1;
  }

  // How much of the height is filled says what the correction did: the worse, the higher.
  drawStatus() {
    const c = this.ctx, wide = this.x(1) - this.x(0);
    this.run.status.forEach((status, k) => {
      const level = LEVELS[status] === undefined ? 1 : LEVELS[status], full = this.height - TOP - 1;
      c.fillStyle = level === 1 ? this.colours.active : this.colours.page_faint;
      c.fillRect(this.x(k) - wide / 2, this.height - 1 - level * full, Math.max(wide, 1), level * full);
    });
  }

  drawTitle(k, cursor) {
    const c = this.ctx, { plot, run } = this, scale = plot.scale || 1;
    c.textBaseline = 'top'; c.textAlign = 'left';
    c.font = '600 12px system-ui, "DejaVu Sans", sans-serif';
    c.fillStyle = this.colours.page_ink;
    const tight = this.width < TIGHT, start = tight ? 4 : LEFT, sample = tight ? 10 : 16;
    c.fillText(plot.title, start, 3);
    let x = start + c.measureText(plot.title).width + 6;
    c.font = `${tight ? 11 : 12}px system-ui, "DejaVu Sans", sans-serif`;
    if (plot.status) {
      c.fillText(remark(run.status[k]) || 'corrected', x, 3);
      return;
    }
    const unit = this.range.cut ? `${plot.unit}, cut at ${plot.cut}` : plot.unit;
    c.fillStyle = this.colours.page_faint;
    c.fillText(unit, x, 3);
    x += c.measureText(unit).width + (tight ? 8 : 12);
    const lines = plot.lines.filter((line) => run.series[line.name].some((v) => v !== null)).reverse();
    if (!lines.length) c.fillText('none', x, 3);
    for (const line of lines) {
      const v = run.series[line.name][k], text = `${line.label} ${v === null ? '–' : number(v * scale)}`;
      if (x + sample + 4 + c.measureText(text).width > this.width) break;  // rather none than half of it
      c.strokeStyle = line.style === 'faint' ? this.colours.page_faint : this.colours.page_ink;
      c.lineWidth = line.style === 'bold' ? 2.2 : 1.2;
      c.setLineDash(line.style === 'dashed' ? [4, 3] : []);
      c.beginPath(); c.moveTo(x, 9); c.lineTo(x + sample, 9); c.stroke(); c.setLineDash([]);
      c.fillStyle = this.colours.page_ink;
      c.fillText(text, x + sample + 4, 3);
      x += sample + 4 + (tight ? c.measureText(text).width + 6 : Math.max(c.measureText(text).width, 62) + 10);
    }
    const k0 = run.series[plot.lines[plot.lines.length - 1].name][k];
    if (k0 === null) return;
    c.beginPath(); c.arc(cursor, this.y(k0 * scale), 3, 0, 7); c.fill();
  }
}

// What a correction's status means, in words; nothing where it simply corrected.
function remark(status) {
  return status ? LOOK.remarks[status] ?? status : 'none';
}

function number(v) {
  const text = v.toFixed(Math.abs(v) < 10 ? 2 : 1);
  return /^-0\.?0*$/.test(text) ? text.slice(1) : text;
}

function niceStep(rough) {
  const base = 10 ** Math.floor(Math.log10(rough));
  return base * [1, 2, 5, 10].find((m) => m * base >= rough - 1e-12);
}

function eventFrames(run) {
  return run.events.filter((e) => e.begun_s !== null && e.begun_s > 0).map((e) => ({
    number: e.number, at: Math.max(run.series.time_s.findIndex((t) => t >= e.begun_s - 1e-6), 0),
  }));
}
