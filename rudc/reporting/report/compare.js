// Differences of two agents in the same episodes, and distributions.

function drawPairs() {
  const a = Number(chosen('pair-a')), b = Number(chosen('pair-b')), name = chosen('pair-metric');
  const k = DATA.pairs.metrics.indexOf(name), metric = DATA.metrics.find((m) => m.name === name);
  const found = DATA.pairs.pairs.find((pair) => pair.a === Math.min(a, b) && pair.b === Math.max(a, b));
  const holder = find('pairs-table');
  if (a === b || !found) {
    holder.replaceChildren(element('caption', {}, a === b ? 'Choose two different agents.' : 'These two have no episode in common.'));
    return;
  }
  const turned = a > b, difference = metric.is_rate ? 'difference (points)' : metric.heading.replace(/^\S+/, 'difference');
  const lines = found.lines.map(([place, values]) => ({ place, ...oriented(values[k], turned) })).filter((line) => line.change !== null);
  const most = Math.max(...lines.flatMap((line) => [line.low, line.high, line.change].filter(Number.isFinite).map(Math.abs)), 1e-9);
  const heads = ['scenario', 'pairs', DATA.agents[a], DATA.agents[b], difference, '', ...(metric.is_rate ? [`only ${DATA.agents[a]}`, `only ${DATA.agents[b]}`, 'p'] : [])];
  const rows = lines.map((line) => element('tr', { class: line.place < 0 ? 'all' : null },
    element('th', { scope: 'row' }, line.place < 0 ? 'all' : DATA.scenarios[line.place]), ...pairCells(line, metric, most)));
  const which = metric.better === 'higher' ? 'right of' : 'left of';
  holder.replaceChildren(
    element('caption', {}, `${metric.heading} of ${DATA.agents[b]} less that of ${DATA.agents[a]}; an interval ${which} the line: ${DATA.agents[b]} is better. Bold: the interval leaves out 0.`),
    element('thead', {}, element('tr', {}, ...heads.map((text, i) => element('th', { scope: 'col', class: i && i !== 5 ? 'number' : null }, text)))), element('tbody', {}, ...rows));
}

function oriented(values, turned) {
  const [n, a, b, change, low, high, more, less, p] = values;
  if (!turned || change === null) return { n, a, b, change, low, high, onlyA: less, onlyB: more, p };
  const minus = (v) => (v === null ? null : -v);
  return { n, a: b, b: a, change: -change, low: minus(high), high: minus(low), onlyA: more, onlyB: less, p };
}

function pairCells(line, metric, most) {
  const digits = decimalsOf(metric, line.change), known = line.low !== null;
  const text = signed(line.change, digits) + (known ? ` [${signed(line.low, digits)}, ${signed(line.high, digits)}]` : '');
  const clear = known && (line.low > 0 || line.high < 0);
  const at = (v) => 50 + 48 * (v / most);
  const picture = shape('svg', { class: 'forest', viewBox: '0 0 100 12', preserveAspectRatio: 'none', 'aria-hidden': 'true' },
    shape('line', { x1: 50, x2: 50, y1: 0, y2: 12, class: 'axis' }),
    known ? shape('line', { x1: at(line.low), x2: Math.max(at(line.high), at(line.low) + 0.5), y1: 6, y2: 6, class: 'bar' }) : null,
    shape('line', { x1: at(line.change), x2: at(line.change), y1: 2, y2: 10, class: 'mark' }));
  const number = (content) => element('td', { class: 'number' }, content);
  return [
    number(String(line.n)), ...[line.a, line.b].map((v) => number(v.toFixed(decimalsOf(metric, v)))),
    number(clear ? element('strong', {}, text) : text), element('td', { class: 'wide' }, picture),
    ...(metric.is_rate ? [number(String(line.onlyA)), number(String(line.onlyB)), number(line.p >= 0.001 ? line.p.toFixed(3) : line.p.toExponential(0))] : []),
  ];
}

function drawDensity() {
  if (!DATA.densities.length) return;
  const column = DATA.densities[Number(chosen('density-column'))];
  const wanted = Number(chosen('density-place'));
  const place = column.places.find((p) => p.place === wanted) ?? column.places[0];
  const step = (column.high - column.low) / Math.max(...place.agents.map((line) => (line[5] ? line[5].length - 1 : 1)));
  const lines = place.agents.map((line, k) => ({
    name: DATA.agents[k], style: lineStyle(k), points: (line[5] ?? []).map((v, i) => [column.low + i * step, (v * place.top) / 999]),
  })).filter((line) => line.points.length);
  const name = column.name + (column.unit ? ` (${column.unit})` : ''), where = place.place < 0 ? 'all scenarios' : DATA.scenarios[place.place];
  const drawn = lines.length ? [lineChart({
    label: `Density of ${name} for each agent, ${where}`, x: [column.low, column.high], y: reach(lines, 0), xName: name, yName: 'density', lines,
  }), legend(lines)] : [element('p', {}, 'Too few values, or equal ones: no curve.')];
  find('density').replaceChildren(...drawn);
  const heads = ['agent', 'n', 'mean', '5 %', 'median', '95 %'];
  find('density-table').replaceChildren(element('caption', {}, `${column.name}: ${column.text}; ${where}`),
    element('thead', {}, element('tr', {}, ...heads.map((text, i) => element('th', { scope: 'col', class: i ? 'number' : null }, text)))),
    element('tbody', {}, ...place.agents.map((line, k) => element('tr', {}, element('th', { scope: 'row' }, ...wrapped(DATA.agents[k])),
      ...line.slice(0, 5).map((v) => element('td', { class: 'number' }, v === null ? '–' : short(v)))))));
}

function beginComparisons() {
  const agents = DATA.agents.map((name, k) => [k, name]);
  if (DATA.agents.length > 1) {
    fillSelect('pair-a', 'a', agents);
    fillSelect('pair-b', 'b', [...agents.slice(1), agents[0]]);
    fillSelect('pair-metric', 'pm', [...DATA.pairs.metrics].sort((x, y) => RATES.includes(y) - RATES.includes(x)).map((name) => [name, DATA.metrics.find((m) => m.name === name).heading]));
    drawings.push(drawPairs);
  }
  if (DATA.densities.length) {
    fillSelect('density-column', 'column', DATA.densities.map((column, k) => [k, column.name + (column.unit ? ` (${column.unit})` : '')]));
    fillSelect('density-place', 'place', [[-1, 'all scenarios'], ...DATA.densities[0].places.filter((p) => p.place >= 0).map((p) => [p.place, DATA.scenarios[p.place]])]);
    drawings.push(drawDensity);
  }
}
