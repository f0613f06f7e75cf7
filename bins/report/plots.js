// Draws the plots of a report page: each <figure class="plot"> holds its data as JSON in a <script>. Called by the page
// itself, after page.js and bars.js. Uses uPlot (global `uPlot`) and the colours of theme.css. Each drawn plot says how many
// points it has: data-drawn.
(function () {
  'use strict';
  const report = window.shoalReport, { color, number } = report;
  const text = (spec, value) => (spec.bytes ? report.bytes(value) : number(value));

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
  function follow(figure, plot, points) {
    const box = report.tip(plot.over);
    plot.over.addEventListener('mousemove', (event) => {
      const left = event.offsetX, top = event.offsetY;
      let best = null, reach = 24 * 24;
      for (const p of points) {
        if (!plot.series[p.s + 1].show) continue;
        const dx = plot.valToPos(p.x, 'x') - left, dy = plot.valToPos(p.y, 'y') - top;
        if (dx * dx + dy * dy < reach) { reach = dx * dx + dy * dy; best = p; }
      }
      if (best === null) return box.hide();
      box.show(best.name + '\n' + figure.spec.x + ' ' + number(best.x) + '\n' + figure.spec.y + ' ' +
               text(figure.spec, best.y), left, top);
    });
    plot.over.addEventListener('mouseleave', box.hide);
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

  // Steps of bytes are powers of two.
  const kByteSteps = Array.from({ length: 60 }, (none, i) => Math.pow(2, i));

  function axis(label, log, size, inBytes) {
    const font = 'px system-ui, "DejaVu Sans", sans-serif';
    const line = { stroke: color('grid'), width: 1 };
    return Object.assign({
      label, stroke: color('quiet'), font: '12' + font, labelFont: '13' + font, labelSize: 24, grid: line, ticks: line, size,
      values: (plot, values) => values.map(inBytes ? report.bytes : number),
    }, inBytes ? { incrs: kByteSteps } : {}, log ? { splits: (plot, side, low, high) => logTicks(low, high), filter: (plot, ticks) => ticks } : {});
  }

  // Half a step of the curve beyond the smallest and the largest: round decades would leave much of the plot empty.
  function range(log) {
    return (plot, low, high) => {
      if (low === null) return [1, 10];
      if (!log) return [low < 0 || low > 0.5 * high ? low - 0.05 * (high - low || 1) : 0, high + 0.05 * (high - low || 1)];
      const reach = Math.max(Math.pow(high / low, 0.06), 1.08);
      return [low / reach, high * reach];
    };
  }

  function draw(figure) {
    const spec = figure.spec, { data, points } = aligned(spec.series);
    const options = {
      width: figure.place.clientWidth, height: figure.element.classList.contains('half') ? 250 : Math.max(320, Math.min(520, figure.place.clientWidth * 0.55)),
      cursor: { drag: { x: false, y: false }, points: { show: false }, x: false, y: false },
      legend: { live: false },
      scales: { x: { time: false, distr: spec.logX ? 3 : 1, range: range(spec.logX) },
                y: { distr: spec.logY ? 3 : 1, range: range(spec.logY) } },
      axes: [axis(spec.x, spec.logX, 30), axis(spec.y, spec.logY, spec.bytes ? 74 : 62, spec.bytes)],
      series: [{ label: spec.x }].concat(spec.series.map((one, s) => {
        const stroke = one.front ? color('ink') : color('series-' + (s % 10 + 1));
        return {
          label: one.label, stroke, width: one.front || !one.dots ? 1.5 : one.line ? 2 : 0, dash: one.front ? [4, 4] : undefined,
          spanGaps: true, paths: one.line ? undefined : () => null,
          points: { show: one.dots, size: one.front ? 15 : 8, width: one.front ? 1.5 : 1, stroke,
                    fill: one.front ? 'transparent' : stroke },
        };
      })),
    };
    if (figure.plot) figure.plot.destroy();
    figure.plot = new uPlot(options, data, figure.place);
    follow(figure, figure.plot, points);
    figure.element.dataset.drawn = String(points.filter((p) => Number.isFinite(p.y) && p.y !== null).length);
  }

  const figures = Array.from(document.querySelectorAll('figure.plot')).map((element) => ({
    element, place: element.querySelector('.place'), plot: null,
    spec: JSON.parse(element.querySelector('script').textContent),
  }));
  if (typeof uPlot === 'undefined') return;  // the page says so in the plots' place
  figures.forEach((figure) => report.draw(() => (figure.spec.groups ? report.drawBars(figure, axis) : draw(figure))));
})();
