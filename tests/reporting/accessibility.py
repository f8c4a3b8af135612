"""What the checker axe finds wrong with a page, in light and in dark."""

from importlib.util import find_spec
from pathlib import Path

from tests.reporting.browser import CHROMIUM, driven

_FOUND = find_spec("axe_core_python")
AXE = Path(_FOUND.submodule_search_locations[0]) / "axe.min.js" if _FOUND else None
MISSING = CHROMIUM is None or AXE is None
SCRIPT = """
document.head.insertAdjacentHTML('beforeend', '<style>* { transition: none !important; }</style>');
document.querySelectorAll('details').forEach((part) => { part.open = true; });
const options = { preload: false, resultTypes: ['violations'] };
const look = () => axe.run(document, options).then((said) => said.violations
  .filter((one) => ['serious', 'critical'].includes(one.impact))
  .map((one) => `${one.id}: ${one.nodes.slice(0, 5).map((node) => node.target.join(' ')).join(', ')}`));
(async () => {
  const light = await look();
  document.documentElement.dataset.theme = 'dark';
  if (document.body.dataset.mdColorScheme) document.body.dataset.mdColorScheme = 'slate';
  document.dispatchEvent(new Event('theme'));
  finish({ light, dark: await look() });
})();
"""


def faults(text: str, folder: Path, width: int = 1400) -> dict:
    """`light`, `dark` -> serious and critical faults of a page whose files lie in `folder`."""
    assert AXE is not None
    checker = AXE.read_text(encoding="utf-8").replace("</script", "<\\/script")
    return driven(text, f"{checker}\n;{SCRIPT}", folder, width)
