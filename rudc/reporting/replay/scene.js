'use strict';
// The junction from above, as rudc/drawing draws it. Metres, y up.

const AHEAD_S = 2.5;

function fitCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  const width = Math.max(Math.round(box.width * ratio), 1), height = Math.max(Math.round(box.height * ratio), 1);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  return ratio;
}

function trace(path, line, close) {
  line.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
  if (close) path.closePath();
  return path;
}

class SceneView {
  constructor(canvas, run) {
    this.canvas = canvas;
    this.run = run;
    this.layers = [];
    for (const [layer, width, ...flat] of run.road) {
      let last = this.layers[this.layers.length - 1];
      if (!last || last.layer !== layer || last.width !== width) {
        last = { layer, width, path: new Path2D() };
        this.layers.push(last);
      }
      trace(last.path, points(flat), !width);
    }
    this.mask = document.createElement('canvas');
  }

  draw(frame, share, camera) {
    const run = this.run, k = Math.min(frame, run.frames - 1), s = frame < run.frames - 1 ? share : 0;
    this.ratio = fitCanvas(this.canvas);
    this.colours = themed();
    const c = this.ctx = this.canvas.getContext('2d'), [ex, ey] = between(run.ego, k, s);
    const width = this.canvas.width, height = this.canvas.height;
    this.scale = Math.min(width, height) / camera.span;
    const [cx, cy] = camera.follows ? towardsJunction(ex, ey, camera.span) : [0, 0];
    this.transform = [this.scale, 0, 0, -this.scale, width / 2 - cx * this.scale, height / 2 + cy * this.scale];
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.fillStyle = this.colours.ground;
    c.fillRect(0, 0, width, height);
    c.setTransform(...this.transform);
    c.lineCap = 'butt'; c.lineJoin = 'round';
    this.drawRoad();
    this.drawReach(k, ex, ey);
    this.drawPatches(k);
    this.drawWay(k, ex, ey);
    this.others = present(run, k);
    for (const t of this.others) this.drawAhead(t, k, s);
    for (const t of this.others) this.drawOther(t, k - t.from, s);
    this.drawSensed(k, s);
    const me = between(run.ego, k, s), own = run.route.blinks, at = run.series.route_s_m[k];
    this.drawBody('car', me, run.vehicle, this.colours.ego, this.egoBrakes(k), false);
    if (own && at >= own[1] && at < own[2]) this.drawBlinkers(me, run.vehicle, own[0]);
    if (camera.yields) for (const t of this.others) this.drawYields(t, k, s, me);
    this.drawConstraints(k, s);
    this.drawEvents(k, s);
    this.drawArms();
    this.drawScale();
  }

  drawRoad() {
    const c = this.ctx;
    for (const { layer, width, path } of this.layers) {
      if (width) {
        c.strokeStyle = this.colours[layer];
        c.lineWidth = Math.max(width * LENGTH, 1 / this.scale);
        c.stroke(path);
      } else {
        c.fillStyle = this.colours[layer];
        c.fill(path);
      }
    }
  }

  // What the sensors do not reach is darker: beyond their range, and behind opaque boxes.
  drawReach(k, ex, ey) {
    const sensors = this.run.sensors.filter((s) => s.from <= k).pop(), c = this.ctx;
    if (!sensors || (sensors.range_m === null && !sensors.boxes.length)) return;
    const mask = this.mask;
    mask.width = this.canvas.width; mask.height = this.canvas.height;
    const m = mask.getContext('2d');
    m.fillStyle = this.colours.hidden_area;
    if (sensors.range_m !== null) {
      m.fillRect(0, 0, mask.width, mask.height);
      m.globalCompositeOperation = 'destination-out';
      m.setTransform(...this.transform);
      m.beginPath(); m.arc(ex, ey, sensors.range_m, 0, 7); m.fill();
      m.globalCompositeOperation = 'source-over';
    }
    m.setTransform(...this.transform);
    const boxes = sensors.boxes.map(([x, y, psi, length, width]) => corners([x, y, psi], [length, width]));
    for (const box of boxes) m.fill(trace(new Path2D(), shadow([ex, ey], box), true));
    c.save();
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.globalAlpha = isDark() ? 0.6 : LOOK.hidden_share;
    c.drawImage(mask, 0, 0);
    c.restore();
    if (sensors.range_m !== null) this.stroke(ring(ex, ey, sensors.range_m), this.colours.sensed, 0.25, [2, 1.5]);
    for (const box of boxes) {
      const path = trace(new Path2D(), box, true);
      c.fillStyle = this.colours.occluder;
      c.fill(path);
      this.stroke(path, this.colours.ink, 0.3);
    }
  }

  // What is slippery.
  drawPatches(k) {
    const time = this.run.series.time_s[k];
    for (const event of this.run.events) {
      if (event.begun_s === null || event.begun_s > time + 1e-6 || isOver(event, k)) continue;
      for (const corners of event.patch) this.drawPatch(corners);
    }
  }

  drawPatch(corners) {
    this.ctx.fillStyle = this.colours.event;
    this.ctx.globalAlpha = 0.4;
    this.ctx.fill(trace(new Path2D(), corners, true));
    this.ctx.globalAlpha = 1;
  }

  drawWay(k, ex, ey) {
    const run = this.run, route = run.route, at = run.series.route_s_m[k], told = run.decisions[k];
    const from = Math.max(Math.floor(at / route.spacing_m), 0);
    const goal = route.goal_m === null ? Infinity : route.goal_m;
    const upTo = Math.min(Math.ceil(goal / route.spacing_m), route.path.length - 1);
    this.stroke(trace(new Path2D(), route.path.slice(from, upTo + 1)), this.colours.path, 0.9);
    const end = route.path[upTo];
    this.stroke(ring(...end, 1.7), this.colours.ego, 0.3);
    this.ctx.fillStyle = this.colours.ego;
    this.ctx.fill(ring(...end, 0.8));
    if (told.course !== undefined) {
      const course = ahead(run.courses[told.course], [ex, ey]);
      this.stroke(trace(new Path2D(), course), this.colours.paper, 0.45, [1.6, 1]);
    }
  }

  // Where somebody whose way crosses the ego's will be in a while: a line if the ego must yield, else dots.
  drawAhead(t, k, share) {
    const i = k - t.from, path = pathOf(this.run, t, i);
    if (!path || !path.yields || t.state[i] & HIDDEN || t.speed[i] < 0.5) return;
    const place = between(t, i, share), line = ahead(path.xy, place);
    if (along(path, place) > path.exit_m) return;
    const count = Math.round((t.speed[i] * AHEAD_S + t.size[0] / 2) / path.spacing_m);
    const way = line.slice(1, count + 2);
    if (way.length < 2) return;
    const first = path.yields === 'ego', end = way[way.length - 1], last = way[way.length - 2];
    this.stroke(trace(new Path2D(), way), this.colours.traffic, first ? 0.3 : 0.22, first ? [] : [0.4, 0.7]);
    const psi = Math.atan2(end[1] - last[1], end[0] - last[0]);
    this.ctx.fillStyle = this.colours.traffic;
    this.ctx.fill(trace(new Path2D(), placed([[1, 0], [0, 0.6], [0, -0.6]], [...end, psi], [1.3, 1.3]), true));
  }

  drawOther(t, i, share) {
    const pose = between(t, i, share), state = t.state[i];
    const colour = eventsOf(t, t.from + i) ? this.colours.event : this.colours.traffic;
    if (t.kind === 'pedestrian') this.drawPedestrian(pose, colour, state & HIDDEN);
    else this.drawBody(t.kind, pose, t.size, colour, state & BRAKES, state & HIDDEN);
    const side = state & HIDDEN || !LOOK.lit.includes(t.kind) ? null : this.blinks(t, i);
    if (side) this.drawBlinkers(pose, t.size, side);
  }

  // From the sign of who yields an arrow, bent to its right, to whom.
  drawYields(t, k, share, me) {
    const name = yieldsTo(t, k), other = this.others.find((o) => o.name === name);
    if (!name || !(other || name === 'ego')) return;
    const from = between(t, k - t.from, share), to = other ? between(other, k - other.from, share) : me;
    this.drawYield(from, to);
  }

  drawYield([x, y], [u, v]) {
    const c = this.ctx, away = Math.hypot(u - x, v - y) || 1, bend = 0.15 * away;
    const middle = [(x + u) / 2 + (bend * (v - y)) / away, (y + v) / 2 - (bend * (u - x)) / away];
    const line = new Path2D(), psi = Math.atan2(v - middle[1], u - middle[0]);
    line.moveTo(x, y); line.quadraticCurveTo(...middle, u, v);
    const head = trace(new Path2D(), placed([[0.6, 0], [-0.9, 0.6], [-0.9, -0.6]], [u, v, psi], [1.2, 1.2]), true);
    this.stroke(line, this.colours.ink, 0.42); this.stroke(line, this.colours.paper, 0.18);
    c.fillStyle = this.colours.paper; c.fill(head); this.stroke(head, this.colours.ink, 0.14);
    const [a, , , d, e, f] = this.transform, r = 7 * this.ratio;
    c.save();
    c.setTransform(1, 0, 0, 1, a * x + e, d * y + f);
    const sign = trace(new Path2D(), [[-r, -0.7 * r], [r, -0.7 * r], [0, r]], true);
    c.fillStyle = this.colours.paper; c.strokeStyle = this.colours.brake_light; c.lineWidth = 2.2 * this.ratio;
    c.fill(sign); c.stroke(sign);
    c.restore();
  }

  // The side that somebody will turn to; null where the way goes straight on, or is over.
  blinks(t, i) {
    const path = pathOf(this.run, t, i);
    if (!path || !path.blinks) return null;
    const [side, from, to] = path.blinks, at = along(path, between(t, i, 0));
    return at >= from && at < to ? side : null;
  }

  drawBlinkers(pose, size, side) {
    for (const part of LOOK.blinkers) {
      const shape = side === 'left' ? part : part.map(([x, y]) => [x, -y]);
      const lamp = trace(new Path2D(), placed(shape, pose, size), true);
      this.ctx.fillStyle = this.colours.blinker;
      this.ctx.fill(lamp);
      this.stroke(lamp, this.colours.ink, 0.1);
    }
  }

  drawBody(kind, pose, size, colour, braking, hidden) {
    const c = this.ctx, outline = trace(new Path2D(), placed(LOOK.body, pose, size), true);
    if (hidden) {
      c.globalAlpha = 0.25; c.fillStyle = colour; c.fill(outline); c.globalAlpha = 1;
      this.stroke(outline, colour, 0.2, [0.7, 0.4]);
      return;
    }
    c.fillStyle = colour; c.fill(outline);
    c.fillStyle = this.colours.glass;
    for (const part of LOOK.dark[kind] || []) c.fill(trace(new Path2D(), placed(part, pose, size), true));
    if (braking && LOOK.lit.includes(kind)) {
      c.fillStyle = this.colours.brake_light;
      for (const part of LOOK.lights) {
        const larger = part.map(([x, y]) => [x < -0.48 ? x - 0.03 : x + 0.02, y]);
        c.fill(trace(new Path2D(), placed(larger, pose, size), true));
      }
    }
    this.stroke(outline, colour === this.colours.event ? this.colours.paper : this.colours.ink, 0.16);
  }

  drawPedestrian([x, y, psi], colour, hidden) {
    const c = this.ctx, r = LOOK.pedestrian_m;
    if (hidden) { this.stroke(ring(x, y, r), colour, 0.2, [0.4, 0.3]); return; }
    c.fillStyle = this.colours.paper; c.fill(ring(x, y, r + 0.16));
    c.fillStyle = colour; c.fill(ring(x, y, r));
    this.stroke(trace(new Path2D(), [[x, y], [x + Math.cos(psi), y + Math.sin(psi)]]), this.colours.ink, 0.25);
  }

  drawSensed(k, share) {
    for (const [name, dx, dy, turn] of this.run.decisions[k].sensed) {
      const t = this.others.find((other) => other.name === name);
      if (!t) continue;
      const [x, y, psi] = between(t, k - t.from, share);
      const pose = [x + dx * LENGTH, y + dy * LENGTH, psi + turn * ANGLE];
      this.stroke(trace(new Path2D(), placed(LOOK.body, pose, t.size), true), this.colours.sensed, 0.2);
    }
  }

  // An ellipse about everybody constrained, bold about those acted on, as the barrier sees them.
  drawConstraints(k, share) {
    const run = this.run, colours = this.colours, me = between(run.ego, k, share);
    let any = false;
    for (const t of this.others) {
      const state = t.state[k - t.from], pose = between(t, k - t.from, share), active = state & ACTIVE;
      if (!active && !(state & CONSTRAINED)) continue;
      this.stroke(ellipse(pose, t.size), active ? colours.active : colours.constrained, active ? 0.45 : 0.18);
      if (active) {
        any = true;
        this.stroke(trace(new Path2D(), [me, pose]), colours.active, 0.25, [1, 0.6]);
      }
    }
    if (any) this.stroke(ellipse(me, run.vehicle), colours.active, 0.3);
    const route = run.route, at = run.series.route_s_m[k];
    for (const side of run.decisions[k].edges || []) {
      const [from, to] = [at - LOOK.behind_m, at + LOOK.ahead_m].map((s) => Math.max(Math.round(s / route.spacing_m), 0));
      this.stroke(trace(new Path2D(), route[side].slice(from, to + 1)), colours.active, 0.5);
    }
  }

  drawEvents(k, share) {
    const run = this.run, time = run.series.time_s[k], numbers = new Set();
    for (const t of this.others) {
      const text = eventsOf(t, k);
      if (!text) continue;
      const [x, y] = between(t, k - t.from, share), own = text.split(',').map(Number);
      own.forEach((number) => numbers.add(number));
      const seen = (e) => own.includes(e.number) && e.visible_s !== null && e.visible_s <= time + 1e-6;
      this.badge(x, y, text, true, run.events.some(seen));
    }
    for (const event of run.events) {
      const begun = event.begun_s !== null && event.begun_s <= time + 1e-6;
      if (event.way && !begun) this.stroke(trace(new Path2D(), event.way), this.colours.event, 0.3, [1, 0.8]);
      if (numbers.has(event.number) || isOver(event, k)) continue;
      for (const [x, y] of event.places) this.badge(x, y, event.number, begun, true);
    }
  }

  // A number, or several, in a disc: grey while its event waits, a broken ring while the ego has not seen it.
  badge(x, y, text, there, seen, aside = 14) {
    const c = this.ctx, r = 9 * this.ratio, [a, , , d, e, f] = this.transform;
    const off = there ? aside * this.ratio : 0, px = a * x + e + off * 0.8, py = d * y + f - off * 0.8;
    c.save();
    c.setTransform(1, 0, 0, 1, px, py);
    c.font = `600 ${12 * this.ratio}px system-ui, "DejaVu Sans", sans-serif`;
    const wider = Math.max((c.measureText(text).width - r) / 2, 0), quarter = Math.PI / 2;
    c.beginPath(); c.arc(wider, 0, r, -quarter, quarter); c.arc(-wider, 0, r, quarter, -quarter); c.closePath();
    c.fillStyle = this.colours.paper; c.fill();
    c.lineWidth = 1.8 * this.ratio; c.strokeStyle = there ? this.colours.event : '#8a9098';
    if (there && !seen) c.setLineDash([3 * this.ratio, 2.4 * this.ratio]);
    c.stroke();
    c.fillStyle = there ? this.colours.ink : '#6e747c';
    c.textAlign = 'center'; c.textBaseline = 'middle';
    c.fillText(text, 0, 0.5);
    c.restore();
  }

  drawArms() {
    for (const arm of this.run.arms) {
      const out = [Math.cos(arm.bearing), Math.sin(arm.bearing)];
      const [x, y] = [arm.entry[0] + out[0] * 16 + out[1] * 9, arm.entry[1] + out[1] * 16 - out[0] * 9];
      this.label(x, y, arm.name + (arm.major ? ' (major)' : ''));
    }
  }

  label(x, y, text) {
    const c = this.ctx, [a, , , d, e, f] = this.transform;
    const { width, height } = this.canvas, px = a * x + e, py = d * y + f, high = 8 * this.ratio;
    if (px < 0 || px > width || py < 0 || py > height) return;
    c.save();
    c.font = `${12 * this.ratio}px system-ui, "DejaVu Sans", sans-serif`;
    const half = c.measureText(text).width / 2 + 3 * this.ratio;  // whole, also at the picture's edge
    const within = (v, side, end) => Math.min(Math.max(v, side), end - side);
    c.setTransform(1, 0, 0, 1, within(px, half, width), within(py, high, height));
    c.textAlign = 'center'; c.textBaseline = 'middle';
    c.lineWidth = 3 * this.ratio; c.strokeStyle = this.colours.ground; c.strokeText(text, 0, 0);
    c.fillStyle = isDark() ? this.colours.paper : this.colours.ink; c.fillText(text, 0, 0);
    c.restore();
  }

  drawScale() {
    const c = this.ctx, r = this.ratio, length = this.scale * 10, left = 12 * r, low = this.canvas.height - 12 * r;
    c.save();
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.fillStyle = c.strokeStyle = isDark() ? this.colours.paper : this.colours.ink;
    c.lineWidth = 2 * r;
    c.strokeRect(left, low - 4 * r, length, 0);
    c.font = `${12 * r}px system-ui, "DejaVu Sans", sans-serif`;
    c.fillText('10 m', left + 4 * r, low - 8 * r);
    c.restore();
  }

  egoBrakes(k) {
    const { acceleration_mps2, speed_mps } = this.run.series;
    return acceleration_mps2[k] < LOOK.brakes_mps2 || speed_mps[k] < LOOK.stands_mps;
  }

  stroke(path, colour, width, dash) {
    const c = this.ctx;
    c.setLineDash(dash || []);
    c.strokeStyle = colour;
    c.lineWidth = Math.max(width, this.ratio / this.scale);
    c.stroke(path);
    c.setLineDash([]);
  }
}

// The middle of a view that follows the ego: drawn to the junction, where things happen.
function towardsJunction(x, y, span) {
  const share = Math.min((0.27 * span) / Math.max(Math.hypot(x, y), 1e-6), 0.5);
  return [x * (1 - share), y * (1 - share)];
}

function placed(shape, [x, y, psi], [length, width]) {
  const cos = Math.cos(psi), sin = Math.sin(psi);
  return shape.map(([u, v]) => [x + u * length * cos - v * width * sin, y + u * length * sin + v * width * cos]);
}

function corners(pose, size) {
  return placed([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]], pose, size);
}

function ring(x, y, radius) {
  const path = new Path2D();
  path.arc(x, y, radius, 0, 2 * Math.PI);
  return path;
}

function ellipse([x, y, psi], [length, width]) {
  const path = new Path2D();
  path.ellipse(x, y, length / 2 + LOOK.kept_m, width / 2 + LOOK.kept_m, psi, 0, 2 * Math.PI);
  return path;
}

// What a box hides from the eye, the box itself left out.
function shadow([ex, ey], box) {
  const away = box.map(([x, y]) => [x - ex, y - ey]);
  const middle = [0, 1].map((i) => away.reduce((total, p) => total + p[i] / away.length, 0));
  const angle = ([x, y]) => Math.atan2(middle[0] * y - middle[1] * x, middle[0] * x + middle[1] * y);
  const sorted = [...away].sort((a, b) => angle(a) - angle(b)), right = sorted[0], left = sorted[sorted.length - 1];
  const far = (p) => p.map((v) => (v * 500) / Math.max(Math.hypot(...p), 1e-6));
  return [right, left, far(left), far(middle), far(right)].map(([x, y]) => [x + ex, y + ey]);
}
