// Runs before anything else of a page: notes when frames were made, and when the curves of a canvas had changed.
(() => {
  const made = []; // ms since the page began
  const paths = new WeakMap(); // path: sum of what it leads through
  const canvases = new Map(); // canvas: { sum: of what was drawn, shown: that of the last frame, drawn: [ms] }
  const touched = new Set();
  const afterwards = new MessageChannel();

  afterwards.port1.onmessage = () => {
    const now = performance.now();
    for (const canvas of touched) {
      const note = canvases.get(canvas);
      if (note.sum !== note.shown) {
        note.shown = note.sum;
        note.drawn.push(now);
      }
      note.sum = 0;
    }
    touched.clear();
  };

  for (const name of ["moveTo", "lineTo"]) {
    const own = Path2D.prototype[name];
    Path2D.prototype[name] = function (x, y) {
      const sum = paths.get(this) ?? 0;
      paths.set(this, (Math.imul(sum, 31) + Math.round(64 * x) + Math.imul(17, Math.round(64 * y))) | 0);
      return own.call(this, x, y);
    };
  }

  const own = CanvasRenderingContext2D.prototype.stroke;
  CanvasRenderingContext2D.prototype.stroke = function (...path) {
    const sum = paths.get(path[0]);
    if (sum !== undefined) {
      const note = canvases.get(this.canvas) ?? { sum: 0, shown: 0, drawn: [] };
      canvases.set(this.canvas, note);
      note.sum = (Math.imul(note.sum, 31) + sum) | 0;
      if (touched.size === 0) afterwards.port2.postMessage(null);
      touched.add(this.canvas);
    }
    return own.apply(this, path);
  };

  const tick = (time) => {
    made.push(time);
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);

  // Panels of the page by the identifiers of their elements, with when their curves were drawn anew.
  window.framesOf = () => {
    const drawn = {};
    for (const plot of document.querySelectorAll(".uplot")) {
      drawn[plot.parentElement.id] = canvases.get(plot.querySelector("canvas"))?.drawn ?? [];
    }
    return { made, drawn };
  };
})();
