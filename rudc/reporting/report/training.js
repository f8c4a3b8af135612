// The report of a training: its curves.

const NAMES = { SR: 'success, SR (%)', VR: 'violations, VR (%)', FR: 'frozen, FR (%)', reward: 'reward of an episode' };

function drawCurves() {
  const arms = chosen('arms'), shown = DATA.curves.filter((curve) => curve.source === 'training' || curve.priority === arms);
  find('curves').replaceChildren(...DATA.metrics.map((metric) => {
    const lines = shown.filter((curve) => curve.metric === metric).map((curve) => ({
      key: curve.scenario || 'while training', name: curve.scenario || 'while training', points: curve.points.map(([x, y]) => [x / 1000, y]),
    }));
    const names = [...new Set(DATA.curves.map((curve) => curve.scenario || 'while training'))];
    for (const line of lines) line.style = lineStyle(names.indexOf(line.key));
    const rate = metric !== 'reward';
    return panel(NAMES[metric] ?? metric, lines, rate ? [0, 100] : reach(lines), true);
  }));
}

function drawStatistics() {
  find('statistics').replaceChildren(...DATA.statistics.map(({ name, points }) => {
    const lines = [{ name, style: lineStyle(0), points: points.map(([x, y]) => [x / 1000, y]) }];
    return panel(name, lines, reach(lines), false);
  }).filter(Boolean));
}

function panel(title, lines, y, keyed) {
  const steps = lines.flatMap((line) => line.points.map((p) => p[0]));
  if (!lines.some((line) => line.points.some((p) => p[1] !== null))) return element('p', {}, `${title}: nothing yet`);
  return element('figure', {}, element('figcaption', {}, title),
    lineChart({ label: `${title} over the decisions taken`, x: [0, Math.max(...steps, 1e-3)], y, xName: 'decisions (thousands)', yName: '', lines, wide: 430 }), keyed ? legend(lines) : null);
}

fillSelect('arms', 'arms', [...new Set(DATA.curves.filter((c) => c.source === 'evaluation').map((c) => c.priority)), 'all'].filter((v, k, all) => all.indexOf(v) === k).map((name) => [name, name]));
drawings.push(drawCurves, drawStatistics);
drawAll();
keepFresh();
