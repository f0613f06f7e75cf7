// Draws the plots of a report page: each <figure class="plot"> holds its data as JSON in a <script>. Called by the page
// itself. Uses uPlot (global `uPlot`) and the colours of theme.css. Errors are noted on the root element, where tests
// look for them: data-errors; each drawn plot says how many points it has: data-drawn.
(function () {
  'use strict';
  const root = document.documentElement;
  const fail = (text) => { root.dataset.errors = (root.dataset.errors ? root.dataset.errors + '; ' : '') + text; };
  window.addEventListener('error', (event) => fail(event.message));

  const color = (name) => getComputedStyle(root).getPropertyValue('--' + name).trim();
  const number = (value) => {
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2).replace('e+', 'e');
    return String(Number(value.toPrecision(3)));
  };

  // One column of x for all series, sorted; each series has a value only at its own points.
  function aligned(series) {
    const points = [];
    series.forEach((one, s) => one.x.forEach((x, i) => points.push({ x, y: one.y[i], s, name: one.names[i] })));
    points.sort((a, b) => a.x - b.x);
    const data = [points.map((p) => p.x)];
    series.forEach((one, s) => data.push(points.map((p) => (p.s === s ? p.y : null))));
    return { data, points };
  }

  // The name and the numbers of the point nearest to the pointer.
  function tip(figure, plot, points) {
    const box = document.createElement('div');
    box.className = 'tip';
    box.hidden = true;
    plot.over.appendChild(box);
    plot.over.addEventListener('mousemove', (event) => {
      const left = event.offsetX, top = event.offsetY;
      let best = null, reach = 24 * 24;
      for (const p of points) {
        if (!plot.series[p.s + 1].show) continue;
        const dx = plot.valToPos(p.x, 'x') - left, dy = plot.valToPos(p.y, 'y') - top;
        if (dx * dx + dy * dy < reach) { reach = dx * dx + dy * dy; best = p; }
      }
      box.hidden = best === null;
      if (best === null) return;
      box.textContent = best.name + '\n' + figure.spec.x + ' ' + number(best.x) + '\n' + figure.spec.y + ' ' + number(best.y);
      box.style.left = Math.min(left + 12, plot.over.clientWidth - box.offsetWidth) + 'px';
      box.style.top = (top + 12) + 'px';
    });
    plot.over.addEventListener('mouseleave', () => { box.hidden = true; });
  }

  // 1, 2 and 5 of each decade; every digit where that would be few, the decades alone where it would be many.
  function logTicks(low, high) {
    const decades = Math.log10(high / low);
    const digits = decades > 4 ? [1] : decades < 0.9 ? [1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9] : [1, 2, 5];
    const ticks = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
      digits.forEach((digit) => ticks.push(Number((digit * Math.pow(10, power)).toPrecision(3))));
    }
    return ticks.filter((tick) => tick >= low && tick <= high);
  }

  function axis(label, log, size) {
    const font = 'px system-ui, "DejaVu Sans", sans-serif';
    const line = { stroke: color('grid'), width: 1 };
    return Object.assign({
      label, stroke: color('quiet'), font: '12' + font, labelFont: '13' + font, labelSize: 24, grid: line, ticks: line, size,
      values: (plot, values) => values.map(number),
    }, log ? { splits: (plot, side, low, high) => logTicks(low, high), filter: (plot, ticks) => ticks } : {});
  }

  // Half a step of the curve beyond the smallest and the largest: round decades would leave much of the plot empty.
  function range(log) {
    return (plot, low, high) => {
      if (low === null) return [1, 10];
      if (!log) return [low - 0.05 * (high - low || 1), high + 0.05 * (high - low || 1)];
      const reach = Math.max(Math.pow(high / low, 0.06), 1.08);
      return [low / reach, high * reach];
    };
  }

  function draw(figure) {
    const spec = figure.spec, { data, points } = aligned(spec.series);
    const options = {
      width: figure.place.clientWidth, height: Math.max(320, Math.min(520, figure.place.clientWidth * 0.55)),
      cursor: { drag: { x: false, y: false }, points: { show: false }, x: false, y: false },
      legend: { live: false },
      scales: { x: { time: false, distr: spec.logX ? 3 : 1, range: range(spec.logX) },
                y: { distr: spec.logY ? 3 : 1, range: range(spec.logY) } },
      axes: [axis(spec.x, spec.logX, 30), axis(spec.y, spec.logY, 62)],
      series: [{ label: spec.x }].concat(spec.series.map((one, s) => {
        const stroke = one.front ? color('ink') : color('series-' + (s % 8 + 1));
        return {
          label: one.label, stroke, width: one.front ? 1.5 : one.line ? 2 : 0, dash: one.front ? [4, 4] : undefined,
          spanGaps: true, paths: one.line ? undefined : () => null,
          points: { show: true, size: one.front ? 15 : 8, width: one.front ? 1.5 : 1, stroke,
                    fill: one.front ? 'transparent' : stroke },
        };
      })),
    };
    if (figure.plot) figure.plot.destroy();
    figure.plot = new uPlot(options, data, figure.place);
    tip(figure, figure.plot, points);
    figure.element.dataset.drawn = String(points.filter((p) => Number.isFinite(p.y) && p.y !== null).length);
  }

  const figures = Array.from(document.querySelectorAll('figure.plot')).map((element) => ({
    element, place: element.querySelector('.place'), plot: null,
    spec: JSON.parse(element.querySelector('script').textContent),
  }));
  const drawAll = () => figures.forEach((figure) => {
    try { draw(figure); } catch (problem) { fail(String(problem)); }
  });
  if (typeof uPlot === 'undefined') return;  // the page says so in the plots' place
  drawAll();
  let waiting = 0;
  window.addEventListener('resize', () => { clearTimeout(waiting); waiting = setTimeout(drawAll, 100); });
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', drawAll);
  window.matchMedia('print').addEventListener('change', drawAll);
})();
