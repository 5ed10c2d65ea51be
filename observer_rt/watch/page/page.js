// What the server sends is drawn here: letters, and curves on a canvas over the axes of each of Bokeh's figures. A figure
// drawn anew takes a browser some ten times as long.
const observerPage = (() => {
  const HALF = 4; // px of a dash
  const RADIUS = 2.5; // px of a dot
  const BYTES = Float32Array.BYTES_PER_ELEMENT;
  const AGAIN_AFTER = 1000; // ms, from one look for the server to the next

  // Draw points, (x, y) in px; of band and bars y is two: low and high. Points that are nan are left out.
  const pens = {
    line(context, x, y) {
      let before = NaN;
      for (let k = 0; k < x.length; k++) {
        if (Number.isNaN(before)) context.moveTo(x[k], y[k]);
        else context.lineTo(x[k], y[k]);
        before = y[k];
      }
      context.stroke();
    },
    band(context, x, low, high) {
      for (let first = 0, end; first < x.length; first = end + 1) {
        for (end = first; end < x.length && !Number.isNaN(low[end] + high[end]); end++);
        if (end === first) continue;
        context.moveTo(x[first], low[first]);
        for (let k = first + 1; k < end; k++) context.lineTo(x[k], low[k]);
        for (let k = end - 1; k >= first; k--) context.lineTo(x[k], high[k]);
        context.closePath();
      }
      context.fill();
    },
    bars(context, x, low, high) {
      for (let k = 0; k < x.length; k++) {
        context.moveTo(x[k], low[k]);
        context.lineTo(x[k], high[k]);
      }
      context.stroke();
    },
    dashes(context, x, y) {
      for (let k = 0; k < x.length; k++) {
        context.moveTo(x[k] - HALF, y[k]);
        context.lineTo(x[k] + HALF, y[k]);
      }
      context.stroke();
    },
    dots(context, x, y) { // squares: a path of a thousand circles takes long
      for (let k = 0; k < x.length; k++) context.fillRect(x[k] - RADIUS, y[k] - RADIUS, 2 * RADIUS, 2 * RADIUS);
    },
  };

  class Panel {
    #canvas;
    #context;
    #view;
    #marks;
    #columns = {};

    constructor(name, marks, view) {
      this.#canvas = document.querySelector(`canvas[data-panel="${name}"]`);
      this.#context = this.#canvas.getContext("2d");
      this.#marks = marks;
      this.#view = view;
      view.canvas_view.overlays.el.style.display = "none"; // empty; a browser takes time for every canvas of a page
      view.repainted.connect(() => this.#paint()); // its axes, or its size, are others
    }

    show({ x, y, columns }) {
      this.#columns = columns;
      const { x_range, y_range } = this.#view.model;
      x_range.setv({ start: x[0], end: x[1] }, { sync: false });
      y_range.setv({ start: y[0], end: y[1] }, { sync: false });
      this.#paint();
    }

    #paint() {
      const { x_range, y_range } = this.#view.model;
      const { width, height } = this.#fit(this.#view.frame.bbox);
      const across = (value) => (width * (value - x_range.start)) / (x_range.end - x_range.start);
      const down = (value) => (height * (y_range.end - value)) / (y_range.end - y_range.start);
      const context = this.#context;
      context.clearRect(0, 0, width, height);
      for (const { kind, x, y, colour, width, dash, alpha } of this.#marks) {
        if (!(x in this.#columns)) continue;
        context.strokeStyle = context.fillStyle = colour;
        context.globalAlpha = alpha;
        context.lineWidth = width;
        context.setLineDash(dash);
        context.beginPath();
        pens[kind](context, this.#columns[x].map(across), ...y.map((name) => this.#columns[name].map(down)));
      }
    }

    // The canvas over the frame of the figure.
    #fit({ x, y, width, height }) {
      const canvas = this.#canvas;
      const ratio = window.devicePixelRatio;
      const [wide, high] = [Math.round(ratio * width), Math.round(ratio * height)];
      if (canvas.width !== wide || canvas.height !== high) {
        canvas.width = wide;
        canvas.height = high;
      }
      Object.assign(canvas.style, { left: `${x}px`, top: `${y}px`, width: `${width}px`, height: `${height}px` });
      this.#context.setTransform(ratio, 0, 0, ratio, 0, 0);
      return { width, height };
    }
  }

  // Ends of the axes, and the columns, which stand one after the other in a message from some place on.
  const unpacked = ({ x, y, lengths, start }, message, place) => {
    const columns = {};
    let from = place + start * BYTES;
    for (const [name, length] of Object.entries(lengths)) {
      columns[name] = new Float32Array(message, from, length);
      from += length * BYTES;
    }
    return { x, y, columns };
  };

  // Nothing new comes: nobody is to take what stands there for the present. Loaded anew once the server is there again.
  const lose = () => {
    const note = document.createElement("div");
    note.className = "fault";
    note.textContent = `No connection to observer-rt monitor since ${new Date().toLocaleTimeString()}: `
      + "all below is old. To do: see that it runs and can be reached; the page goes on by itself.";
    document.getElementById("top").replaceChildren(note);
    const look = () => fetch(location.href).then(() => location.reload(), () => setTimeout(look, AGAIN_AFTER));
    setTimeout(look, AGAIN_AFTER);
  };

  // Draw what comes, each in the next frame, and answer with its number.
  const begin = (figures, marks, index) => {
    const panels = new Map();
    for (const figure of figures) panels.set(figure.name, new Panel(figure.name, marks[figure.name], index.get(figure)));
    const waiting = new Map(); // by name: what is to be drawn in the next frame
    let last = 0;
    const url = new URL(`drawings?page=${document.getElementById("top").dataset.token}`, location.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    socket.onclose = lose;
    window.addEventListener("beforeunload", () => { socket.onclose = null; });
    socket.onmessage = ({ data }) => {
      const place = BYTES + new DataView(data).getUint32(0, true);
      const { number, parts } = JSON.parse(new TextDecoder().decode(new Uint8Array(data, BYTES, place - BYTES)));
      if (waiting.size === 0) {
        requestAnimationFrame(() => {
          for (const show of waiting.values()) show();
          waiting.clear();
          socket.send(last);
        });
      }
      last = number;
      for (const [name, part] of Object.entries(parts)) {
        waiting.set(name, () => {
          if (typeof part === "string") document.getElementById(name).innerHTML = part;
          else panels.get(name).show(unpacked(part, data, place));
        });
      }
    };
  };

  return { begin };
})();
