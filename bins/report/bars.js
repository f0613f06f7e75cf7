// Bars of a report page: groups of bars beside each other, a colour a series, or one bar a group with the series on top of
// each other. Called by plots.js, whose figures and axes it takes. Uses uPlot.
(function () {
  'use strict';
  const report = window.shoalReport;

  // Where each bar stands, from where to where it reaches, and what it says.
  function layout(spec) {
    const bars = [], step = spec.stacked ? 1 : spec.series.length + 1, tops = spec.groups.map(() => 0);
    spec.series.forEach((series, s) => series.x.forEach((group, i) => {
      const value = series.y[i], from = spec.stacked ? tops[group] : 0;
      bars.push({ x: group * step + (spec.stacked ? 0 : s), from, to: from + value, value, s, group });
      tops[group] += value;
    }));
    const centers = spec.groups.map((name, g) => g * step + (spec.stacked ? 0 : (spec.series.length - 1) / 2));
    return { bars, tops, centers, step };
  }

  // One column of x for all series; on top of each other, the last series is drawn first, so that the others cover it.
  function aligned(spec, bars) {
    const xs = Array.from(new Set(bars.map((bar) => bar.x))).sort((a, b) => a - b);
    const columns = spec.series.map((series, s) => xs.map((x) => {
      const bar = bars.find((one) => one.s === s && one.x === x);
      return bar ? bar.to : null;
    }));
    const order = spec.series.map((series, s) => (spec.stacked ? spec.series.length - 1 - s : s));
    return { data: [xs].concat(order.map((s) => columns[s])), order };
  }

  const text = (spec, value) => (spec.bytes ? report.bytes(value) : report.number(value));

  // What each bar is worth, above it, where there is room.
  function write(plot, spec, { bars, tops, centers }) {
    const ctx = plot.ctx, ratio = window.devicePixelRatio || 1;
    const unit = Math.abs(plot.valToPos(1, 'x', true) - plot.valToPos(0, 'x', true));
    ctx.save();
    ctx.font = 11 * ratio + 'px system-ui, "DejaVu Sans", sans-serif';
    ctx.fillStyle = report.color('quiet');
    ctx.textAlign = 'center';
    const put = (x, y, words) => {
      if (ctx.measureText(words).width < unit * 1.1) {
        ctx.fillText(words, plot.valToPos(x, 'x', true), plot.valToPos(y, 'y', true) - 4 * ratio);
      }
    };
    if (spec.stacked) centers.forEach((x, g) => put(x, tops[g], text(spec, tops[g])));
    else bars.forEach((bar) => put(bar.x, bar.to, text(spec, bar.value)));
    ctx.restore();
  }

  function follow(plot, spec, bars) {
    const box = report.tip(plot.over);
    plot.over.addEventListener('mouseleave', box.hide);
    plot.over.addEventListener('mousemove', (event) => {
      const x = plot.posToVal(event.offsetX, 'x'), y = plot.posToVal(event.offsetY, 'y');
      const bar = bars.find((one) => Math.abs(one.x - x) < 0.5 && (!spec.stacked || (y >= one.from && y < one.to)));
      if (!bar) return box.hide();
      box.show(spec.groups[bar.group] + '\n' + spec.series[bar.s].label + '\n' + text(spec, bar.value) + ' ' + spec.y,
               event.offsetX, event.offsetY);
    });
  }

  report.drawBars = (figure, axis) => {
    const spec = figure.spec, placed = layout(spec), { bars, centers, step } = placed;
    const { data, order } = aligned(spec, bars);
    const values = bars.map((bar) => bar.to), most = Math.max(...values), least = Math.min(...values);
    const width = figure.place.clientWidth, narrow = width / spec.groups.length < 110;
    const x = axis(spec.x, false, narrow ? 44 : 30), y = axis(spec.y, spec.logY, 62, spec.bytes);
    const options = {
      width, height: Math.max(280, Math.min(420, width * 0.42)),
      cursor: { drag: { x: false, y: false }, points: { show: false }, x: false, y: false },
      legend: { live: false },
      scales: { x: { time: false, range: [-0.75, (spec.groups.length - 1) * step + (spec.stacked ? 0.75 : step - 1.25)] },
                y: { distr: spec.logY ? 3 : 1, range: spec.logY ? [least / 3, most * 2] : [0, most * 1.1] } },
      axes: [Object.assign(x, { splits: () => centers, grid: { show: false }, ticks: { show: false },
                                values: () => spec.groups.map((name) => (narrow ? name.replace(/ /g, '\n') : name)) }), y],
      series: [{ label: spec.x }].concat(order.map((s) => ({
        label: spec.series[s].label, stroke: report.color('series-' + (s % 10 + 1)),
        fill: report.color('series-' + (s % 10 + 1)), width: 0, points: { show: false },
        paths: uPlot.paths.bars({ size: [spec.stacked ? 0.6 : 0.92, 140] }),
      }))),
      hooks: { draw: [(plot) => write(plot, spec, placed)] },
    };
    if (figure.plot) figure.plot.destroy();
    figure.plot = new uPlot(options, data, figure.place);
    follow(figure.plot, spec, bars);
    figure.element.dataset.drawn = String(bars.length);
  };
})();
