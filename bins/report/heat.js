// Heat maps of a report page: each <figure class="heat"> holds the values of its cells as JSON in a <script>; they stand row
// by row, coloured by the logarithm. Called by the page itself. Each drawn map says how many cells it has: data-drawn.
(function () {
  'use strict';
  const report = window.shoalReport;
  const kMostColumns = 64, kWidth = 330, kLargestCell = 28;

  const channels = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  // From 0 to 1, between the five colours of the theme.
  function ramp() {
    const stops = [1, 2, 3, 4, 5].map((i) => channels(report.color('heat-' + i)));
    return (share) => {
      const at = Math.min(Math.max(share, 0), 1) * 4, i = Math.min(Math.floor(at), 3);
      const mixed = stops[i].map((low, c) => Math.round(low + (stops[i + 1][c] - low) * (at - i)));
      return 'rgb(' + mixed.join(',') + ')';
    };
  }

  function scale(element, spec) {
    const bar = document.createElement('i'), ends = [document.createElement('span'), document.createElement('span')];
    bar.style.background = 'linear-gradient(to right, ' +
        [1, 2, 3, 4, 5].map((i) => report.color('heat-' + i)).join(', ') + ')';
    ends[0].textContent = '1';
    ends[1].textContent = report.number(spec.end) + ' ' + spec.unit;
    element.replaceChildren(ends[0], bar, ends[1]);
  }

  function follow(figure) {
    const { element, canvas, spec } = figure, box = report.tip(element);
    canvas.addEventListener('mouseleave', box.hide);
    canvas.addEventListener('mousemove', (event) => {
      const column = Math.floor(event.offsetX / figure.side), row = Math.floor(event.offsetY / figure.side);
      const cell = row * figure.columns + column;
      if (column >= figure.columns || cell >= spec.cells.length) return box.hide();
      const first = cell * spec.itemsACell, last = Math.min(first + spec.itemsACell, spec.items) - 1;
      const name = first === last ? 'treelet ' + first : 'treelets ' + first + ' to ' + last;
      box.show(name + '\n' + spec.cells[cell] + ' ' + spec.unit, canvas.offsetLeft + event.offsetX,
               canvas.offsetTop + event.offsetY);
    });
  }

  function draw(figure) {
    const { canvas, spec } = figure, ratio = window.devicePixelRatio || 1, color = ramp();
    figure.columns = Math.max(1, Math.min(kMostColumns, Math.ceil(Math.sqrt(spec.cells.length))));
    figure.side = Math.max(2, Math.min(kLargestCell, Math.floor(kWidth / figure.columns)));
    const rows = Math.max(1, Math.ceil(spec.cells.length / figure.columns)), side = figure.side;
    canvas.width = figure.columns * side * ratio;
    canvas.height = rows * side * ratio;
    canvas.style.width = figure.columns * side + 'px';
    canvas.style.height = rows * side + 'px';
    const ctx = canvas.getContext('2d');
    ctx.scale(ratio, ratio);
    const whole = Math.log1p(spec.end);
    spec.cells.forEach((value, i) => {
      ctx.fillStyle = value === 0 ? report.color('field') : color(whole > 0 ? Math.log1p(value) / whole : 0);
      ctx.fillRect(i % figure.columns * side, Math.floor(i / figure.columns) * side, side, side);
    });
    scale(figure.element.querySelector('.scale'), spec);
    figure.element.dataset.drawn = String(spec.cells.length);
  }

  document.querySelectorAll('figure.heat').forEach((element) => {
    const figure = { element, canvas: element.querySelector('canvas'), columns: 1, side: 1,
                     spec: JSON.parse(element.querySelector('script').textContent) };
    follow(figure);
    report.draw(() => draw(figure));
  });
})();
