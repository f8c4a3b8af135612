// What the page was given, decoded: numbers in m, rad, s.

const DATA = JSON.parse(document.getElementById('data').textContent);
const LOOK = JSON.parse(document.getElementById('look').textContent);
const LENGTH = 0.01, ANGLE = 0.001;
const BRAKES = 1, HIDDEN = 2, CONSTRAINED = 4, ACTIVE = 8;

function sums(differences, step) {
  let total = 0;
  return differences.map((d) => (total += d) * step);
}

function points(flat) {
  const found = [];
  let x = 0, y = 0;
  for (let i = 0; i + 1 < flat.length; i += 2) {
    x += flat[i]; y += flat[i + 1];
    found.push([x * LENGTH, y * LENGTH]);
  }
  return found;
}

function poses(p) {
  return { x: sums(p.x, LENGTH), y: sums(p.y, LENGTH), psi: sums(p.psi, ANGLE) };
}

function decoded(run) {
  const series = {};
  for (const [name, step] of Object.entries(DATA.steps)) {
    series[name] = run.series[name].map((v) => (v === null ? null : v * step));
  }
  const tracks = run.tracks.map((t) => ({
    ...t, ...poses(t.poses), speed: sums(t.speed, 0.1), state: [...t.state].map((c) => parseInt(c, 16)),
  }));
  const route = {
    ...run.route, path: points(run.route.path), left: points(run.route.left), right: points(run.route.right),
  };
  const events = run.events.map((e) => ({ ...e, way: e.way && points(e.way), patch: e.patch.map(points) }));
  const paths = {};
  for (const [row, path] of Object.entries(run.paths)) paths[row] = { ...path, xy: points(path.xy) };
  return {
    ...run, paths, series, tracks, route, events,
    road: run.road || DATA.runs[0].road, ego: poses(run.ego), courses: run.courses.map(points),
  };
}

const RUNS = DATA.runs.map(decoded);
const FRAMES = Math.max(...RUNS.map((run) => run.frames));

// Times of the page are those of its longest episode.
function timeAt(frame) {
  return times()[frame];
}

// The first frame from a time on; the last where none is so late.
function frameAt(second) {
  const frame = times().findIndex((t) => t >= second - 1e-6);
  return frame < 0 ? FRAMES - 1 : frame;
}

function times() {
  return RUNS.find((run) => run.frames === FRAMES).series.time_s;
}

// The pose at a time between frames, for smooth motion; `k` counts from the track's first frame.
function between(track, k, share) {
  const n = Math.min(k + 1, track.x.length - 1);
  const mix = (v) => v[k] + (v[n] - v[k]) * share;
  return [mix(track.x), mix(track.y), mix(track.psi)];
}

// What of a line lies ahead of a place, from the point nearest to it.
function ahead(line, [x, y]) {
  const away = line.map(([u, v]) => Math.hypot(u - x, v - y));
  return line.slice(away.indexOf(Math.min(...away)));
}

// The way through the junction that a track is on in its frame i; undefined off all ways.
function pathOf(run, track, i) {
  return run.paths[lastOf(track.path, track.from + i)];
}

// The name of whom a track yields to in frame k, or null.
function yieldsTo(track, k) {
  return lastOf(track.yields, k);
}

// The numbers of the events that a track takes part in in frame k, such as '1' or '1,2', or null.
function eventsOf(track, k) {
  return lastOf(track.events, k);
}

// Of values with the frames from which on they hold, the one of frame k; null before the first.
function lastOf(values, k) {
  const [, value] = values.filter(([from]) => from <= k).pop() || [0, null];
  return value;
}

// How far along a way a place is, m.
function along(path, place) {
  return (path.xy.length - ahead(path.xy, place).length) * path.spacing_m;
}

function present(run, k) {
  return run.tracks.filter((t) => t.from <= k && k < t.from + t.x.length);
}

// Whether an event is over at step k; one that a shorter one replaced for a while is on again afterwards.
function isOver(event, k) {
  return event.over.some(([from, to]) => k >= from && (to === null || k < to));
}

function themed() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  const look = { ...LOOK.colours };
  const dark = { ground: '#23282a', verge: '#30372f', asphalt: '#4a5059', reserved: '#423d3b', pavement: '#5b5a56' };
  if (isDark()) Object.assign(look, dark);
  return { ...look, page_ink: colour('ink'), page_faint: colour('faint'), page_line: colour('line'), card: colour('card') };
}
