// Elements, and charts of lines. Agents and variants are told apart by colour, dashes and the legend's order.

const DATA = JSON.parse(find('data').textContent);
const LOOK = JSON.parse(find('look').textContent);
const DASHES = ['', '7 3', '2 3', '9 3 2 3', '12 4', '4 2 1 2 1 2'];
const MINUS = '−';

function element(name, attributes, ...children) {
  const made = document.createElement(name);
  return filled(made, attributes, children);
}

function shape(name, attributes, ...children) {
  return filled(document.createElementNS('http://www.w3.org/2000/svg', name), attributes, children);
}

function filled(made, attributes, children) {
  for (const [key, value] of Object.entries(attributes || {})) {
    if (key.startsWith('on')) made.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(key, value === true ? '' : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

// A name that may go on in the next line after a sign.
function wrapped(name) {
  return name.split(/(?<=[_:,+=])/).flatMap((part, k) => (k ? [document.createElement('wbr'), part] : [part]));
}

function signed(value, decimals) {
  const text = Math.abs(value).toFixed(decimals);
  return Number(text) === 0 ? text : (value > 0 ? '+' : MINUS) + text;
}

// With how many decimals a metric's value, or its change, is written: more for a rate that would look like 0 or 100 and is not.
function decimalsOf(metric, value) {
  const enough = [0, 1, 2, 3].map((more) => metric.decimals + more).find((n) => ![0, 100].includes(Math.abs(Number(value.toFixed(n)))));
  return metric.is_rate ? (enough ?? metric.decimals) : metric.decimals;
}

function short(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size < 0.01 || size >= 1e5)) return value.toExponential(1);
  return String(Number(value.toPrecision(3)));
}

function lineStyle(k) {
  const colours = LOOK.series;
  const colour = colours[k % colours.length];
  return { stroke: isDark() ? lighter(colour) : colour, 'stroke-dasharray': DASHES[Math.floor(k / colours.length + k) % DASHES.length] };
}

function lighter(colour) {
  const [r, g, b] = colour.match(/\d+/g).map(Number);
  const mixed = [r, g, b].map((v) => Math.round(v + (255 - v) * 0.35));
  return `rgb(${mixed})`;
}

// Round numbers between two ends, about `count` of them.
function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const found = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) found.push(Number(v.toPrecision(12)));
  return found;
}

// How many units wide a chart is drawn that may be as wide as `most`: on a narrow screen fewer, so that its text stays legible.
function fitting(most) {
  return Math.min(most, Math.max(document.documentElement.clientWidth - 40, 280));
}

// chart: { label, x: [low, high], y: [low, high], xName, yName, lines: [{ name, points: [[x, y]], style }], numbered, wide }
function lineChart(chart) {
  const wide = fitting(chart.wide ?? 640), tall = 250, left = 54, right = 12, top = 10, bottom = 36;
  const [x0, x1] = chart.x, [y0, y1] = chart.y;
  const px = (v) => left + ((v - x0) / (x1 - x0 || 1)) * (wide - left - right);
  const py = (v) => tall - bottom - ((v - y0) / (y1 - y0 || 1)) * (tall - top - bottom);
  const picture = shape('svg', { viewBox: `0 0 ${wide} ${tall}`, role: 'img', 'aria-label': chart.label, class: 'chart' });
  for (const v of ticks(y0, y1, 4)) {
    picture.append(shape('line', { x1: left, x2: wide - right, y1: py(v), y2: py(v), class: 'grid' }));
    if (chart.numbered !== false) picture.append(shape('text', { x: left - 6, y: py(v) + 4, 'text-anchor': 'end' }, short(v)));
  }
  for (const v of ticks(x0, x1, wide < 500 ? 4 : 6)) {
    picture.append(shape('line', { x1: px(v), x2: px(v), y1: tall - bottom, y2: tall - bottom + 4, class: 'axis' }));
    picture.append(shape('text', { x: px(v), y: tall - bottom + 17, 'text-anchor': 'middle' }, short(v)));
  }
  picture.append(shape('line', { x1: left, x2: wide - right, y1: tall - bottom, y2: tall - bottom, class: 'axis' }));
  picture.append(shape('text', { x: (left + wide - right) / 2, y: tall - 4, 'text-anchor': 'middle' }, chart.xName));
  const name = shape('text', { transform: `translate(12 ${(tall - bottom + top) / 2}) rotate(-90)`, 'text-anchor': 'middle' }, chart.yName);
  picture.append(name);
  for (const line of chart.lines) {
    let path = '', open = false;
    for (const [x, y] of line.points) {
      if (y === null) { open = false; continue; }
      path += `${open ? 'L' : 'M'}${px(x).toFixed(1)} ${py(y).toFixed(1)}`;
      open = true;
    }
    picture.append(shape('path', { d: path, class: 'curve', ...line.style }, shape('title', {}, line.name)));
    if (line.points.length === 1 && line.points[0][1] !== null) {
      picture.append(shape('circle', { cx: px(line.points[0][0]), cy: py(line.points[0][1]), r: 3, fill: line.style.stroke }));
    }
  }
  return picture;
}

function legend(lines) {
  return element('ul', { class: 'key' }, ...lines.map(({ name, style }) => element('li', {},
    shape('svg', { viewBox: '0 0 34 10', width: 34, height: 10, 'aria-hidden': 'true' }, shape('line', { x1: 1, x2: 33, y1: 5, y2: 5, class: 'curve', ...style })), name)));
}

// From the least to the largest y of all lines, with some room.
function reach(lines, least, most) {
  const values = lines.flatMap((line) => line.points.map((p) => p[1]).filter((v) => v !== null));
  if (!values.length) return [0, 1];
  let low = least ?? Math.min(...values), high = most ?? Math.max(...values);
  if (low === high) { low -= 0.5; high += 0.5; }
  return [low, high + (most === undefined ? 0.05 * (high - low) : 0)];
}
