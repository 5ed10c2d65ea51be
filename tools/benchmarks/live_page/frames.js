// Runs before anything else of a page: notes when frames were made, and when what a canvas shows had changed.
(() => {
  const made = [];  // ms since the page began
  const canvases = new Map();  // canvas: { sum: of what was drawn, shown: that of the last frame, drawn: [ms] }
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

  const note = (canvas, x, y) => {
    let found = canvases.get(canvas);
    if (found === undefined) canvases.set(canvas, (found = { sum: 0, shown: 0, drawn: [] }));
    found.sum = (Math.imul(found.sum, 31) + Math.round(64 * x) + Math.imul(17, Math.round(64 * y))) | 0;
    if (!touched.has(canvas)) {
      if (touched.size === 0) afterwards.port2.postMessage(null);
      touched.add(canvas);
    }
  };

  const prototype = CanvasRenderingContext2D.prototype;
  for (const name of ["moveTo", "lineTo"]) {
    const own = prototype[name];
    prototype[name] = function (x, y) {
      note(this.canvas, x, y);
      return own.call(this, x, y);
    };
  }

  const tick = (time) => {
    made.push(time);
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);

  // Panels of the page by their names, with when their curves were drawn anew: on canvases that bear the name of a
  // panel, or on those of Bokeh's figures themselves.
  window.framesOf = () => {
    const drawn = {};
    const add = (name, canvas) => { drawn[name] = canvases.get(canvas)?.drawn ?? []; };
    for (const document of Bokeh.documents) {
      for (const root of document.roots()) {
        const canvas = Bokeh.index.find_one(root)?.canvas_view?.primary?.canvas;
        if (canvas !== undefined) add(root.name, canvas);
      }
    }
    for (const canvas of document.querySelectorAll("canvas[data-panel]")) add(canvas.dataset.panel, canvas);
    return { made, drawn };
  };
})();
