// Tables of a study: rows chosen by what they say, sorted by a column.
(() => {
  const number = (text) => parseFloat(text.replace('−', '-'));

  function sort(table, column, button) {
    const up = button.parentElement.getAttribute('aria-sort') !== 'ascending';
    table.querySelectorAll('th').forEach((head) => head.removeAttribute('aria-sort'));
    button.parentElement.setAttribute('aria-sort', up ? 'ascending' : 'descending');
    const said = (row) => row.cells[column].textContent;
    const order = (a, b) => {
      const [x, y] = [number(said(a)), number(said(b))];
      if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
      const less = Number.isNaN(x) ? said(a).localeCompare(said(b)) : x - y;
      return up ? less : -less;
    };
    const body = table.tBodies[0];
    body.append(...[...body.rows].sort(order));
  }

  for (const table of document.querySelectorAll('table[id^=rows-]')) {
    table.querySelectorAll('thead button').forEach((button, column) => {
      button.addEventListener('click', () => sort(table, column, button));
    });
  }
  for (const input of document.querySelectorAll('input[data-table]')) {
    input.addEventListener('input', () => {
      const words = input.value.toLowerCase().split(/\s+/);
      const rows = [...find(input.dataset.table).tBodies[0].rows];
      rows.forEach((row) => { row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word)); });
      input.closest('p').querySelector('output').textContent = `${rows.filter((row) => !row.hidden).length} rows`;
    });
  }
})();
