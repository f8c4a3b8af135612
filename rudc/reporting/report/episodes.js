// How episodes ended, whether events happened, and the worst episodes.

const LETTERS = { success: 'S', frozen: 'F', collision: 'C', off_road: 'O', wrong_way: 'W' };
const WORST_ROWS = 25;
let shownWorst = WORST_ROWS;

function summed(counts, agent, place) {
  return place < 0 ? counts.reduce((total, line) => total + line[agent], 0) : counts[place][agent];
}

function drawEnds() {
  const place = Number(chosen('ends-place')), { outcomes, errors, faults } = DATA.counts;
  find('ends').replaceChildren(...DATA.agents.map((agent, k) => {
    const counts = Object.entries(outcomes).map(([name, all]) => [name, summed(all, k, place)]);
    const total = counts.reduce((sum, [, n]) => sum + n, 0), failed = summed(errors, k, place);
    const blame = Object.entries(faults).map(([name, all]) => [name, summed(all, k, place)]).filter(([, n]) => n);
    const told = counts.filter(([, n]) => n).map(([name, n]) => `${LOOK.outcomes[name]?.words ?? name} ${n}`).join(', ');
    return element('tr', {}, element('th', { scope: 'row' }, ...wrapped(agent)), element('td', { class: 'wide' }, stack(counts, total)),
      element('td', {}, told || 'no episode', failed ? `; ${failed} could not be run` : ''),
      element('td', {}, blame.length ? blame.map(([name, n]) => `${name} ${n}`).join(', ') : '–'));
  }));
}

function stack(counts, total) {
  return element('div', { class: 'stack', 'aria-hidden': 'true' }, ...counts.filter(([, n]) => n).map(([name, n]) => {
    const share = (100 * n) / total;
    return element('span', { class: `part ${name}`, style: `width: ${share}%; background-color: ${LOOK.outcomes[name]?.colour ?? 'var(--faint)'}`, title: `${name}: ${n}` },
      share >= 4 ? element('b', {}, LETTERS[name] ?? '') : null);
  }));
}

function drawEvents() {
  const wanted = chosen('events-agent');
  find('events-table').replaceChildren(...DATA.events.map((entry) => {
    const lines = wanted === '' ? entry.agents : [entry.agents[Number(wanted)]];
    const [n, some, all, seen] = [0, 1, 2, 3].map((i) => lines.reduce((sum, line) => sum + line[i], 0));
    const times = lines.filter((line) => line[4] !== null), counted = times.reduce((sum, line) => sum + line[1], 0);
    const first = counted ? (times.reduce((sum, line) => sum + line[4] * line[1], 0) / counted).toFixed(1) : '–';
    const share = (part, of) => (of ? `${((100 * part) / of).toFixed(0)} %` : '–');
    const number = (text, ...more) => element('td', { class: 'number' }, text, ...more);
    return element('tr', {}, element('th', { scope: 'row' }, DATA.scenarios[entry.scenario]),
      element('td', {}, counted_(entry.kinds).join(', ') || 'not known'), number(String(n)),
      number(share(some, n), whisker({ mean: n ? (100 * some) / n : NaN }, [0, 100])), number(entry.kinds.length ? share(all, n) : '–'), number(share(seen, some)), number(first));
  }));
}

// 'a', 'a', 'b' -> '2 × a', 'b'
function counted_(names) {
  const all = new Map();
  for (const name of names) all.set(name, (all.get(name) ?? 0) + 1);
  return [...all].map(([name, n]) => (n > 1 ? `${n} × ${name}` : name).replaceAll('_', ' '));
}

function drawWorst() {
  const scenario = chosen('worst-scenario'), agent = chosen('worst-agent'), outcome = chosen('worst-outcome');
  const lines = DATA.worst.filter((line) => (scenario === '' || line[1] === Number(scenario)) && (agent === '' || line[2] === Number(agent)) && (outcome === '' || line[5] === outcome));
  const shown = lines.slice(0, shownWorst);
  find('worst-table').replaceChildren(...shown.map(([row, s, a, seed, swept, end, fault, gap, way, first, which, page]) => {
    const command = DATA.replayed && `${DATA.rudc} replay ${DATA.replayed} --episode ${which} --out replay.html`;
    const number = (value, unit) => element('td', { class: 'number' }, value === null ? '–' : `${value} ${unit}`);
    return element('tr', {}, element('td', { class: 'number' }, String(row)), element('th', { scope: 'row' }, DATA.scenarios[s] + (swept ? ` (${swept})` : '')),
      element('td', {}, DATA.agents[a]), element('td', { class: 'number' }, seed),
      element('td', {}, `${LOOK.outcomes[end]?.words ?? end}${fault ? `, fault: ${fault}` : ''}`), number(gap, 'm'), number(way, '%'), number(first, 's'),
      element('td', {}, page ? element('a', { href: `${DATA.replays}/${encodeURIComponent(page)}` }, 'open replay') : null, page ? ' ' : null,
        ...(command ? [element('code', {}, command), element('button', { type: 'button', class: 'copy', 'aria-label': `Copy the command for row ${row}`, onclick: (event) => copy(event, command) }, 'copy')] : [])));
  }));
  find('worst-count').textContent = `${shown.length} of ${lines.length}`;
  find('worst-more').hidden = shown.length >= lines.length;
}

function copy(event, text) {
  const button = event.target;
  const done = () => { button.textContent = 'copied'; };
  const select = () => {
    const range = document.createRange();
    range.selectNodeContents(button.previousElementSibling);
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    button.textContent = 'selected';
  };
  if (navigator.clipboard) navigator.clipboard.writeText(text).then(done, select);
  else select();
}

function beginEpisodes() {
  const all = [['', 'all']], scenarios = DATA.scenarios.map((name, k) => [k, name]), agents = DATA.agents.map((name, k) => [k, name]);
  fillSelect('ends-place', 'ends', [[-1, 'all'], ...scenarios]);
  fillSelect('worst-scenario', 'ws', [...all, ...scenarios]);
  fillSelect('worst-agent', 'wa', [...all, ...agents]);
  fillSelect('worst-outcome', 'wo', [...all, ...[...new Set(DATA.worst.map((line) => line[5]))].map((name) => [name, LOOK.outcomes[name]?.words ?? name])]);
  find('worst-more').addEventListener('click', () => { shownWorst += 4 * WORST_ROWS; drawWorst(); });
  drawings.push(drawEnds, drawWorst);
  if (DATA.events.length) {
    fillSelect('events-agent', 'ea', [...all, ...agents]);
    drawings.push(drawEvents);
  }
}
