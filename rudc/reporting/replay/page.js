// The page: time, keys, buttons, lists.

const MARKS = { event: '⚑', correction: '↧', infeasible: '✕', gap: '↔', h: 'h', sigma: 'σ', end: '■' };
const state = { at: 0, playing: false, last: 0, follows: true, yields: true, span: 62, widest: 150 };

const parts = RUNS.map((run, i) => {
  const section = document.querySelector(`[data-run="${i}"]`), holder = section.querySelector('.plots');
  const plots = plotsOf(RUNS).map((plot) => new PlotView(holder, run, plot, go));
  if (RUNS.some((r) => r.status.some((s) => s))) {
    plots.push(new PlotView(holder, run, { title: 'Correction', status: true, lines: [] }, go));
  }
  const scene = new SceneView(section.querySelector('canvas.scene'), run);
  const buttons = listMoments(run, section.querySelector('.moments'));
  return { run, section, scene, plots, buttons, now: section.querySelector('.now'), acts: section.querySelector('.acts') };
});

function listMoments(run, list) {
  return run.moments.map((moment) => {
    const item = document.createElement('li'), button = document.createElement('button');
    button.type = 'button';
    button.textContent = `${run.series.time_s[moment.frame].toFixed(1)} s  ${MARKS[moment.kind] || ''} ${moment.text}`;
    button.addEventListener('click', () => go(moment.frame));
    item.append(button); list.append(item);
    return { button, frame: moment.frame };
  });
}

function markMoments() {
  const holder = find('marks');
  RUNS.forEach((run) => run.moments.forEach((moment) => {
    const mark = document.createElement('span');
    mark.textContent = MARKS[moment.kind] || '·';
    mark.title = moment.text;
    mark.style.left = `${(100 * moment.frame) / Math.max(FRAMES - 1, 1)}%`;
    mark.addEventListener('click', () => go(moment.frame));
    holder.append(mark);
  }));
}

function go(frame) {
  stop();
  state.at = Math.min(Math.max(frame, 0), FRAMES - 1);
  show();
}

// The next moment of any run, or the one before (by = -1).
function goToMoment(by) {
  const frames = RUNS.flatMap((run) => run.moments.map((moment) => moment.frame)).sort((a, b) => by * (a - b));
  const frame = frames.find((at) => by * (at - state.at) > 1e-9);
  if (frame !== undefined) go(frame);
}

// On the scene a tap plays or stops, a drag to the side goes through time, two fingers zoom.
function followFingers(canvas) {
  const down = new Map();
  let begun = null;
  const apart = () => {
    const [a, b] = [...down.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
  };
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, event);
    if (down.size === 1) begun = { x: event.clientX, at: state.at, moved: false };
    else begun = { ...begun, moved: true, apart: apart() };
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!down.has(event.pointerId)) return;
    down.set(event.pointerId, event);
    if (down.size === 2) {
      zoom(begun.apart / Math.max(apart(), 1));
      begun.apart = apart();
    } else if (begun.apart === undefined) {
      const by = event.clientX - begun.x;
      begun.moved = begun.moved || Math.abs(by) > 6;
      if (begun.moved) go(Math.round(begun.at + (by / canvas.clientWidth) * (FRAMES - 1)));
    }
  });
  const lift = (event) => {
    down.delete(event.pointerId);
    if (event.type === 'pointerup' && begun && !begun.moved) play();
    if (!down.size) begun = null;
  };
  canvas.addEventListener('pointerup', lift);
  canvas.addEventListener('pointercancel', lift);
}

function stop() {
  state.playing = false;
  find('play').textContent = 'Play';
}

function play() {
  if (state.playing) { stop(); return; }
  if (state.at >= FRAMES - 1) state.at = 0;
  state.playing = true; state.last = 0;
  find('play').textContent = 'Stop';
  requestAnimationFrame(tick);
}

function tick(now) {
  if (!state.playing) return;
  const passed = state.last ? (now - state.last) / 1000 : 0;
  state.last = now;
  state.at = Math.min(state.at + (passed * Number(find('speed').value)) / RUNS[0].decision_s, FRAMES - 1);
  if (state.at >= FRAMES - 1) stop();
  show();
  if (state.playing) requestAnimationFrame(tick);
}

function show() {
  const frame = Math.floor(state.at + 1e-9), share = state.at - frame;
  const camera = { follows: state.follows, span: state.follows ? state.span : state.widest, yields: state.yields };
  for (const part of parts) {
    part.scene.draw(frame, share, camera);
    for (const plot of part.plots) plot.draw(frame, share);
    tell(part, frame);
    for (const { button, frame: at } of part.buttons) button.setAttribute('aria-current', String(at === frame));
  }
  const time = find('time'), seconds = timeAt(frame).toFixed(1);
  time.value = String(frame);
  time.setAttribute('aria-valuetext', `${seconds} s`);
  find('clock').textContent = `${seconds} s of ${timeAt(FRAMES - 1).toFixed(1)} s`;
}

function tell({ run, now, acts }, frame) {
  const k = Math.min(frame, run.frames - 1), s = run.series, value = (name) => s[name][k];
  const parts = [`${value('time_s').toFixed(1)} s`, `${number(value('speed_mps'))} m/s`];
  if (value('gap_m') !== null) parts.push(`gap ${number(value('gap_m'))} m`);
  if (value('sigma') !== null) parts.push(`sigma ${number(value('sigma'))}`);
  if (k === run.frames - 1) parts.push(`ended: ${run.outcome.replace('_', ' ')}`);
  now.textContent = parts.join('  ·  ');
  acts.textContent = [correction(run, k), ...(state.yields ? yielding(run, k) : []), ...standing(run, k)].join('  ·  ');
}

function correction(run, k) {
  const status = run.status[k], s = run.series, told = run.decisions[k];
  const bounded = told.bounded || [0, 0];
  const a = s.safe_acceleration_mps2[k] - s.nominal_acceleration_mps2[k] - bounded[0];
  const turn = s.safe_steering_rad[k] - s.nominal_steering_rad[k] - bounded[1];
  const done = change(a, turn), bounds = change(...bounded);
  const asks = told.asks_grip ? '  ·  brakes to learn how well the road grips' : '';
  if (!status) return (done ? `changed by ${done}` : 'no correction') + asks;
  const named = (t) => t.kind + (eventsOf(t, k) ? ` (${eventsOf(t, k)})` : '');
  const kinds = present(run, k).filter((t) => t.state[k - t.from] & ACTIVE).map(named);
  const because = [...counted(kinds), ...(told.edges || []).map((side) => `${side} road edge`), ...(told.others || [])];
  const said = told.infeasible && status === 'solved' ? 'infeasible' : remark(status);
  const rest = (bounds ? `  ·  changed for course and grip: ${bounds}` : '') + asks;
  return `correction: ${[done + (because.length ? ` because of ${because.join(', ')}` : ''), said].filter((t) => t.trim()).join('; ')}${rest}`;
}

// m/s² and rad -> '-1.2 m/s², +0.5 deg'; empty where both would read as 0.0
function change(a, turn) {
  const sizes = [[a, 'm/s²'], [turn * DEGREES, 'deg']].filter(([v]) => Math.abs(v) >= 0.05);
  return sizes.map(([v, unit]) => `${v > 0 ? '+' : ''}${v.toFixed(1)} ${unit}`).join(', ');
}

// How many yield at frame k, and how many of them to the ego; nothing if nobody does.
function yielding(run, k) {
  const whom = present(run, k).map((t) => yieldsTo(t, k)).filter((name) => name);
  const ego = whom.filter((name) => name === 'ego').length;
  return whom.length ? [`${whom.length} yield${whom.length > 1 ? '' : 's'}, ${ego || 'none'} to the ego`] : [];
}

// 'car', 'car', 'bus' -> '2 × car', 'bus'
function counted(names) {
  const all = new Map();
  for (const name of names) all.set(name, (all.get(name) || 0) + 1);
  return [...all].map(([name, n]) => (n > 1 ? `${n} × ${name}` : name));
}

// How each event stands.
function standing(run, k) {
  const time = run.series.time_s[k], named = (event) => `(${event.number}) ${event.kind.replaceAll('_', ' ')}`;
  const absent = run.absent.map((event) => `${named(event)}: not in this episode`);
  return [...run.events.map((event) => {
    const name = named(event);
    if (event.begun_s === null || event.begun_s > time + 1e-6) return `${name}: waits`;
    if (isOver(event, k)) return `${name}: over`;
    if (event.visible_s === null || event.visible_s > time + 1e-6) return `${name}: not ${event.patch.length ? 'reached' : 'seen'} yet`;
    return name;
  }), ...absent];
}

function zoom(by) {
  const name = state.follows ? 'span' : 'widest';
  state[name] = Math.min(Math.max(state[name] * by, 15), 400);
  show();
}

function setView(value) {
  state.follows = value === 'follow';
  find('view').value = value;
  show();
}

function showYields(shown) {
  state.yields = shown;
  find('yields').checked = shown;
  show();
}

// Pictures of what the scene shows, drawn by the scene's own code.
function drawLegend() {
  const list = find('legend'), run = RUNS[0];
  const samples = [
    ['the ego', (v) => v.drawBody('car', [0, 0, 0], [4.6, 1.8], v.colours.ego, false, false)],
    ['brakes or stands', (v) => v.drawBody('car', [0, 0, 0], [4.6, 1.8], v.colours.traffic, true, false)],
    ['will turn left', (v) => {
      v.drawBody('car', [0, 0, 0], [4.6, 1.8], v.colours.traffic, false, false);
      v.drawBlinkers([0, 0, 0], [4.6, 1.8], 'left');
    }],
    ['not seen by the ego', (v) => v.drawBody('car', [0, 0, 0], [4.6, 1.8], v.colours.traffic, false, true)],
    ['takes part in an event', (v) => v.drawBody('truck', [0, 0, 0], [6, 2], v.colours.event, false, false)],
    ['pedestrian', (v) => v.drawPedestrian([0, 0, 0], v.colours.traffic, false)],
    ['constrained', (v) => v.stroke(ellipse([0, 0, 0], [4.6, 1.8]), v.colours.constrained, 0.18)],
    ['acted on', (v) => v.stroke(ellipse([0, 0, 0], [4.6, 1.8]), v.colours.active, 0.45)],
    ['way to the destination', (v) => v.stroke(trace(new Path2D(), [[-3, 0], [3, 0]]), v.colours.path, 0.9)],
  ];
  const ways = [['has priority over the ego, next 2.5 s', 0.3, []], ['must yield to the ego', 0.22, [0.4, 0.7]]];
  for (const [text, width, dash] of ways) {
    samples.push([text, (v) => v.stroke(trace(new Path2D(), [[-3, 0], [3, 0]]), v.colours.traffic, width, dash)]);
  }
  samples.push(['yields, and to whom', (v) => v.drawYield([-2.4, 0, 0], [2.2, 0, 0])]);
  if (run.events.length) {
    samples.push(['event that waits', (v) => v.badge(0, 0, run.events[0].number, false, true)],
      ['event that the ego has not seen', (v) => v.badge(0, 0, run.events[0].number, true, false, 0)],
      ['event', (v) => v.badge(0, 0, run.events[0].number, true, true, 0)]);
  }
  if (run.events.some((event) => event.patch.length)) {
    samples.push(['slippery', (v) => v.drawPatch([[-3, -1], [3, -1], [3, 1], [-3, 1]])]);
  }
  if (run.courses.length) {
    samples.push(['course round what blocks', (v) => v.stroke(trace(new Path2D(), [[-3, 0], [3, 0]]), v.colours.paper, 0.45, [1.6, 1])]);
  }
  list.replaceChildren();
  for (const [text, paint] of samples) {
    const item = document.createElement('li'), canvas = document.createElement('canvas');
    item.append(canvas, text); list.append(item);
    const view = new SceneView(canvas, { road: [] });
    view.ratio = fitCanvas(canvas); view.colours = themed(); view.ctx = canvas.getContext('2d');
    view.ctx.fillStyle = view.colours.asphalt; view.ctx.fillRect(0, 0, canvas.width, canvas.height);
    view.scale = canvas.width / 7.5;
    view.transform = [view.scale, 0, 0, -view.scale, canvas.width / 2, canvas.height / 2];
    view.ctx.setTransform(...view.transform);
    paint(view);
  }
}

const KEYS = {
  ' ': play, ArrowLeft: (e) => go(Math.ceil(state.at) - (e.shiftKey ? 10 : 1)),
  ArrowRight: (e) => go(Math.floor(state.at) + (e.shiftKey ? 10 : 1)), Home: () => go(0), End: () => go(FRAMES - 1),
  n: () => goToMoment(1), p: () => goToMoment(-1),
  '+': () => zoom(0.8), '=': () => zoom(0.8), '-': () => zoom(1.25), f: () => setView(state.follows ? 'all' : 'follow'),
  y: () => showYields(!state.yields),
};

document.addEventListener('keydown', (event) => {
  const act = KEYS[event.key], where = event.target.tagName;
  const pressed = where === 'BUTTON' || where === 'SUMMARY' || event.target.type === 'checkbox';
  const taken = where === 'SELECT' || (event.key === ' ' && pressed);
  if (!act || taken || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  act(event);
});
find('time').max = String(FRAMES - 1);
find('time').addEventListener('input', (event) => go(Number(event.target.value)));
find('play').addEventListener('click', play);
find('back').addEventListener('click', () => go(Math.ceil(state.at) - 1));
find('on').addEventListener('click', () => go(Math.floor(state.at) + 1));
find('in').addEventListener('click', () => zoom(0.8));
find('out').addEventListener('click', () => zoom(1.25));
find('yields').addEventListener('change', (event) => showYields(event.target.checked));
find('view').addEventListener('change', (event) => setView(event.target.value));
parts.forEach((part) => followFingers(part.scene.canvas));
window.addEventListener('resize', show);
document.addEventListener('theme', () => { drawLegend(); show(); });
markMoments();
drawLegend();
// #12.3 opens the page at that second
const wanted = Number(location.hash.slice(1));
go(wanted > 0 ? frameAt(wanted) : 0);
