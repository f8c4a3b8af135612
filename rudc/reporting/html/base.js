'use strict';
// What all pages share: elements, light and dark.

const find = (name) => document.getElementById(name);

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === 'dark' : window.matchMedia('(prefers-color-scheme: dark)').matches;
}

// Pages draw anew on the event `theme`.
function setTheme(theme) {
  if (theme) document.documentElement.dataset.theme = theme;
  else delete document.documentElement.dataset.theme;
  find('theme').textContent = theme || 'as the system';
  find('theme').setAttribute('aria-label', `Light or dark: ${find('theme').textContent}`);
  try { localStorage.setItem('rudc-theme', theme); } catch { /* a browser that keeps nothing of files */ }
  document.dispatchEvent(new Event('theme'));
}

(() => {
  let kept = '';
  try { kept = localStorage.getItem('rudc-theme') || ''; } catch { /* as above */ }
  if (kept) setTheme(kept);
  const next = { '': 'dark', dark: 'light', light: '' };
  find('theme').addEventListener('click', () => setTheme(next[document.documentElement.dataset.theme || '']));
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => document.dispatchEvent(new Event('theme')));
})();
