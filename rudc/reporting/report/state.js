// What the reader chose: kept in the address, so that a page that loads itself again, or is sent on, shows the same.

const state = Object.fromEntries([...new URLSearchParams(location.hash.slice(1))].filter(([, value]) => value !== ''));
const drawings = [];

function choose(key, value) {
  if (value === '' || value === undefined) delete state[key];
  else state[key] = String(value);
  keep();
  drawAll();
}

function keep() {
  history.replaceState(null, '', `#${new URLSearchParams(state)}`);
}

// A link to a part of the page has led there, and left its name in the address.
window.addEventListener('hashchange', () => {
  if (find(location.hash.slice(1))) keep();
});

function drawAll() {
  for (const draw of drawings) draw();
}

// A list to choose from; `options`: [value, text]. The first is chosen unless the address says otherwise.
function fillSelect(id, key, options) {
  const list = find(id);
  list.replaceChildren(...options.map(([value, text]) => element('option', { value }, text)));
  const known = options.map(([value]) => String(value));
  list.value = known.includes(state[key]) ? state[key] : known[0];
  list.addEventListener('change', () => choose(key, list.value));
}

function chosen(id) {
  return find(id).value;
}

// The page of something that goes on loads itself again, unless the reader is at work in it.
function keepFresh() {
  if (!LOOK.live) return;
  const box = find('fresh');
  box.checked = state.fresh !== '0';
  box.addEventListener('change', () => choose('fresh', box.checked ? '' : '0'));
  setInterval(() => {
    const busy = ['SELECT', 'INPUT'].includes(document.activeElement?.tagName) && document.activeElement !== box;
    if (box.checked && !busy) location.reload();
  }, 5000);
}
document.addEventListener('theme', drawAll);
