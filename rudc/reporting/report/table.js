// The heat map and the table of metrics.

const RATES = DATA.metrics.filter((metric) => metric.is_rate).map((metric) => metric.name);
const TABLE_ROWS = 200;
let shownRows = TABLE_ROWS;

function parsed(text) {
  const numbers = text.replace(/[()[\],]/g, ' ').trim().split(/\s+/).map(Number);
  return { mean: numbers[0], low: text.includes('[') ? numbers[1] : NaN, high: text.includes('[') ? numbers[2] : NaN };
}

// Numbers of the scenarios whose `values` these are, those with no mean last; `sign`: -1 where lower is better.
function hardestFirst(values, sign) {
  const means = values.map((row) => { const v = row.filter((x) => x).map((x) => x[0]); return v.reduce((a, b) => a + b, 0) / v.length; });
  const order = [...means.keys()], known = order.filter((k) => !Number.isNaN(means[k]));
  return [...known.sort((a, b) => sign * (means[a] - means[b])), ...order.filter((k) => Number.isNaN(means[k]))];
}

function drawHeat() {
  const name = chosen('heat-metric'), values = DATA.heat[name];
  const metric = DATA.metrics.find((m) => m.name === name);
  const known = values.flat().filter((v) => v).map((v) => v[0]);
  const [low, high] = RATES.includes(name) ? [0, 100] : [Math.min(...known), Math.max(...known)];
  const order = chosen('heat-order') === 'hard' ? hardestFirst(values, metric.better === 'lower' ? -1 : 1) : [...values.keys()];
  const head = element('tr', {}, element('th', { scope: 'col' }, 'scenario'),
    ...DATA.agents.map((agent) => element('th', { scope: 'col' }, ...wrapped(agent))));
  const lines = order.map((k) => element('tr', {},
    element('th', { scope: 'row' }, element('button', { type: 'button', class: 'link', title: 'Show this scenario in the table of metrics', onclick: () => filterBy(DATA.scenarios[k]) }, ...wrapped(DATA.scenarios[k]))),
    ...values[k].map((value) => heatCell(value, metric, (v) => (v - low) / (high - low || 1)))));
  const total = DATA.tables.find((table) => table.by.join() === 'agent');
  const at = DATA.metrics.indexOf(metric), whole = DATA.agents.map((agent) => total.lines.find(([key]) => key[0] === agent)?.[3][at] ?? '–');
  lines.push(element('tr', { class: 'total' }, element('th', { scope: 'row' }, 'all'), ...whole.map((text) => element('td', { title: text }, text.split(' ')[0]))));
  find('heat').replaceChildren(element('caption', {}, `${metric.heading}: ${metric.text}; ${metric.better} is better. The fuller the colour, the higher. Point at a cell for its interval.`),
    element('thead', {}, head), element('tbody', {}, ...lines));
}

function heatCell(value, metric, share) {
  if (!value) return element('td', { class: 'none' }, '–');
  const [mean, low, high] = value.map((v) => v?.toFixed(decimalsOf(metric, value[0])));
  const interval = low === undefined ? 'too few different values for an interval' : `95 % interval ${low} to ${high}`;
  const depth = Math.round(4 + 46 * share(value[0]));
  return element('td', { style: `background: color-mix(in srgb, var(--accent) ${depth}%, var(--card))`, title: `${mean}, ${interval}` }, mean);
}

function filterBy(text) {
  find('filter').value = text;
  choose('filter', text);
  find('metrics').scrollIntoView();
}

function drawTable() {
  const table = DATA.tables[Number(chosen('by'))], words = find('filter').value.toLowerCase().split(/\s+/).filter(Boolean);
  let lines = table.lines.filter(([key]) => words.every((word) => key.join(' ').toLowerCase().includes(word)));
  const [column, down] = [state.sort ?? '', state.down === '1'];
  if (column !== '') lines = sorted(lines, column, down, table.by);
  const shown = lines.slice(0, shownRows);
  const scales = DATA.metrics.map((metric, k) => {
    const ends = lines.flatMap((line) => { const v = parsed(line[3][k]); return [v.low, v.high, v.mean].filter(Number.isFinite); });
    return metric.is_rate ? [0, 100] : [Math.min(...ends), Math.max(...ends)];
  });
  const heads = [...table.by.map((name, k) => [`k${k}`, name]), ['n', 'n'], ...DATA.metrics.map((metric, k) => [`m${k}`, `${metric.heading} ${{ higher: '↑', lower: '↓' }[metric.better] ?? ''}`])];
  const head = element('tr', {}, ...heads.map(([id, text]) => {
    const way = column === id ? (down ? 'descending' : 'ascending') : 'none';
    const metric = id[0] === 'm' ? DATA.metrics[Number(id.slice(1))] : null;
    return element('th', { scope: 'col', 'aria-sort': way, class: metric ? 'number' : null },
      element('button', { type: 'button', class: 'link', 'data-sort': id, title: metric ? `${metric.text}; sort` : 'sort', onclick: () => sortBy(id) }, text, { ascending: ' ▲', descending: ' ▼', none: '' }[way]));
  }));
  find('table').replaceChildren(element('thead', {}, head), element('tbody', {}, ...shown.map((line) => tableRow(line, scales))));
  find('table-count').textContent = `${lines.length} of ${table.lines.length} lines${table.left_out ? `, and ${table.left_out} more in the command's output` : ''}`;
  find('table-more').hidden = lines.length <= shown.length;
  find('table-command').textContent = table.command;
}

function tableRow([key, episodes, errors, cells, best], scales) {
  return element('tr', {}, ...key.map((text) => element('th', { scope: 'row' }, ...wrapped(text))),
    element('td', { class: 'number' }, String(episodes) + (errors ? ` (+${errors} failed)` : '')),
    ...cells.map((text, k) => element('td', { class: 'number', 'data-metric': DATA.metrics[k].name }, best.includes(k) ? element('strong', {}, text) : text, whisker(parsed(text), scales[k]))));
}

// An interval drawn to the scale of its column.
function whisker({ mean, low, high }, [from, to]) {
  if (!Number.isFinite(mean)) return null;
  const at = (v) => 2 + 96 * ((v - from) / (to - from || 1));
  const picture = shape('svg', { class: 'whisker', viewBox: '0 0 100 8', preserveAspectRatio: 'none', 'aria-hidden': 'true' },
    shape('line', { x1: 0, x2: 100, y1: 4, y2: 4, class: 'grid' }));
  if (Number.isFinite(low)) picture.append(shape('line', { x1: at(low), x2: Math.max(at(high), at(low) + 1), y1: 4, y2: 4, class: 'bar' }));
  picture.append(shape('line', { x1: at(mean), x2: at(mean), y1: 0, y2: 8, class: 'mark' }));
  return picture;
}

function sorted(lines, column, down, by) {
  const k = Number(column.slice(1));
  const value = (line) => {
    if (column === 'n') return line[1];
    if (column[0] === 'm') return parsed(line[3][k]).mean;
    const text = line[0][k], number = Number(text);
    return text !== '' && Number.isFinite(number) ? number : text;
  };
  const compare = (a, b) => (typeof a === 'number' && typeof b === 'number' ? a - b : String(a).localeCompare(String(b)));
  const known = lines.filter((line) => !Number.isNaN(value(line))), rest = lines.filter((line) => Number.isNaN(value(line)));
  if (column[0] === 'k' && k >= by.length) return lines;
  return [...known.sort((a, b) => (down ? -1 : 1) * compare(value(a), value(b))), ...rest];
}

// Once: best first for metrics, A to Z for names; again: the other way; a third time: as swept.
function sortBy(id) {
  const first = id[0] === 'm' && DATA.metrics[Number(id.slice(1))].better !== 'lower' ? '1' : '0';
  if (state.sort !== id) { state.sort = id; state.down = first; }
  else if (state.down === first) state.down = first === '1' ? '0' : '1';
  else { delete state.sort; delete state.down; }
  choose('sort', state.sort);
  document.querySelector(`[data-sort="${id}"]`)?.focus();
}

function beginTables() {
  fillSelect('heat-metric', 'heat', [...RATES, ...Object.keys(DATA.heat).filter((name) => !RATES.includes(name))].map((name) => [name, DATA.metrics.find((m) => m.name === name).heading]));
  fillSelect('heat-order', 'order', [['as', 'as swept'], ['hard', 'hardest first']]);
  fillSelect('by', 'by', DATA.tables.map((table, k) => [k, table.by.join(', ')]));
  find('filter').value = state.filter ?? '';
  find('filter').addEventListener('input', () => { shownRows = TABLE_ROWS; choose('filter', find('filter').value); });
  find('table-more').addEventListener('click', () => { shownRows += 5 * TABLE_ROWS; drawTable(); });
  drawings.push(drawHeat, drawTable);
}
