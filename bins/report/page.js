// What the drawings of a report page share: colours of theme.css, numbers as text, the box that follows the pointer, the
// button for light and dark, and when to draw again. Called by the scripts after it. Errors are noted on the root element,
// where tests look for them: data-errors.
(function () {
  'use strict';
  const root = document.documentElement;
  const fail = (text) => { root.dataset.errors = (root.dataset.errors ? root.dataset.errors + '; ' : '') + text; };
  window.addEventListener('error', (event) => fail(event.message));

  const color = (name) => getComputedStyle(root).getPropertyValue('--' + name).trim();
  const number = (value) => {
    const size = Math.abs(value);
    if (size >= 1e5 && size < 1e14) {
      const power = Math.floor(Math.log10(size) / 3);
      return Number((value / Math.pow(1000, power)).toPrecision(3)) + ['', ' k', ' M', ' G', ' T'][power];
    }
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2).replace('e+', 'e');
    return String(Number(value.toPrecision(3)));
  };
  const bytes = (value) => {
    const units = ['B', 'KiB', 'MiB', 'GiB', 'TiB'];
    let unit = 0;
    while (Math.abs(value) >= 1000 && unit + 1 < units.length) { value /= 1024; unit += 1; }
    return Number(value.toPrecision(3)) + ' ' + units[unit];
  };

  // A box over `place`: show(text, left, top) and hide().
  function tip(place) {
    const box = document.createElement('div');
    box.className = 'tip';
    box.hidden = true;
    place.appendChild(box);
    return {
      hide: () => { box.hidden = true; },
      show: (text, left, top) => {
        box.hidden = false;
        box.textContent = text;
        box.style.left = Math.max(0, Math.min(left + 12, place.clientWidth - box.offsetWidth)) + 'px';
        box.style.top = (top + 12) + 'px';
      },
    };
  }

  const drawings = [];
  const attempt = (drawing) => { try { drawing(); } catch (problem) { fail(String(problem)); } };
  const drawAll = () => drawings.forEach(attempt);
  let waiting = 0;
  window.addEventListener('resize', () => { clearTimeout(waiting); waiting = setTimeout(drawAll, 100); });
  const systemDark = window.matchMedia('(prefers-color-scheme: dark)');
  window.matchMedia('print').addEventListener('change', drawAll);

  const button = document.querySelector('button.theme');
  const dark = () => (root.dataset.theme ? root.dataset.theme === 'dark' : systemDark.matches);
  const label = () => { button.textContent = dark() ? 'light' : 'dark'; };
  button.hidden = false;
  button.title = 'Colours of this page';
  label();
  button.addEventListener('click', () => {
    root.dataset.theme = dark() ? 'light' : 'dark';
    label();
    drawAll();
  });
  systemDark.addEventListener('change', () => { label(); drawAll(); });

  // draw(drawing): now, and whenever sizes or colours change.
  window.shoalReport = {
    fail, color, number, bytes, tip, draw: (drawing) => { drawings.push(drawing); attempt(drawing); },
  };
})();
