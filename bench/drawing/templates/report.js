// Lets the report answer. Without it everything is there, and nothing moves.
"use strict";
(() => {
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const make = (tag, attributes, ...children) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  };
  const drawn = (tag, attributes) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  };
  const button = (text, click) => {
    const made = make("button", { type: "button" }, text);
    made.addEventListener("click", click);
    return made;
  };
  const number = (v) => {
    const size = Math.abs(v);
    if (v === 0) return "0";
    if (size < 1e-5 || size >= 1e7) return v.toExponential(2);
    return size >= 100 ? Math.round(v).toLocaleString("en") : v.toPrecision(3);
  };

  // What cannot be seen yet is laid out once the page is there, not piece by piece while it is read.
  addEventListener("load", () => document.body.classList.remove("opening"));

  // Backends: what is of one is shown or not, in every figure; rows of tables are dimmed.
  const hidden = new Set();
  const toggles = new Map();
  const show = (k, shown) => {
    if (shown) hidden.delete(k); else hidden.add(k);
    toggles.get(k).setAttribute("aria-pressed", shown);
    for (const element of all(`.of-${k}`)) {
      const off = [...element.classList].some((name) => name.startsWith("of-") && hidden.has(name.slice(3)));
      element.classList.toggle("off", off);
    }
  };
  const bar = document.querySelector(".bar");
  bar.removeAttribute("tabindex");
  for (const name of all("[data-of]", bar)) {
    const k = name.dataset.of;
    const toggle = button("", () => show(k, hidden.has(k)));
    toggle.append(...name.childNodes);
    toggle.dataset.of = k;
    toggles.set(k, toggle);
    name.replaceWith(toggle);
    show(k, true);
  }
  const rest = make("span", { class: "rest" });
  rest.append(
    button("All", () => { for (const k of toggles.keys()) show(k, true); }), " ",
    button("None", () => { for (const k of toggles.keys()) show(k, false); }),
  );
  bar.append(rest);
  new ResizeObserver(() => document.documentElement.style.setProperty("--bar", `${bar.offsetHeight}px`)).observe(bar);

  const root = document.documentElement.style;
  const theme = button("", () => paint(root.colorScheme === "dark" ? "light" : "dark"));
  const paint = (scheme) => {
    root.colorScheme = scheme;
    theme.textContent = scheme === "dark" ? "Light page" : "Dark page";
  };
  paint(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  document.querySelector("header").append(theme);

  // Tables: sorted by a click on a heading, blanks last; filtered where there are many rows.
  const value = (cell) => {
    if (cell.dataset.v !== undefined) return Number(cell.dataset.v);
    return (cell.tagName === "TH" ? cell : cell.firstChild ?? cell).textContent.trim().toLowerCase();
  };
  const compared = (a, b) => {
    if (typeof a === typeof b) return a < b ? -1 : a > b ? 1 : 0;
    return typeof a === "number" ? -1 : 1;
  };
  const sort = (table, heading) => {
    const ways = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    for (const other of all("th[aria-sort]", table.tHead)) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", ways === 1 ? "ascending" : "descending");
    const rows = [...table.tBodies[0].rows].map((row) => [value(row.cells[heading.cellIndex]), row]);
    rows.sort(([a], [b]) => (a === "") - (b === "") || ways * compared(a, b));
    table.tBodies[0].append(...rows.map(([, row]) => row));
  };
  const filtered = (table, caption) => {
    const found = make("span", { role: "status" });
    const box = make("input", { type: "search", placeholder: "filter rows", "aria-label": `filter: ${caption}` });
    box.addEventListener("input", () => {
      const words = box.value.toLowerCase().split(/\s+/);
      const rows = [...table.tBodies[0].rows];
      for (const row of rows) {
        const text = row.textContent.toLowerCase();
        row.hidden = !words.every((word) => text.includes(word));
      }
      found.textContent = box.value ? `${rows.filter((row) => !row.hidden).length} of ${rows.length} rows` : "";
    });
    return make("div", { class: "filter" }, box, found);
  };
  for (const table of all("table.sorts")) {
    for (const heading of table.tHead.rows[0].cells) {
      const press = button("", () => sort(table, heading));
      press.append(...heading.childNodes);
      heading.append(press);
    }
    const scroll = table.closest(".scroll");
    if (table.tBodies[0].rows.length >= 6) scroll.before(filtered(table, scroll.getAttribute("aria-label")));
  }

  // Plots: the values nearest to a pointer or, with arrow keys, to the place that was stepped to.
  const nearest = (values, wanted) => {
    let best = -1;
    values.forEach((v, i) => {
      if (v !== null && (best < 0 || Math.abs(v - wanted) < Math.abs(values[best] - wanted))) best = i;
    });
    return best;
  };
  const place = (axis, v, from, to) => {
    const on = axis.log ? Math.log : (w) => w;
    return from + ((on(v) - on(axis.low)) / (on(axis.high) - on(axis.low))) * (to - from);
  };
  const within = (axis, share) => axis.log
    ? axis.low * (axis.high / axis.low) ** share : axis.low + share * (axis.high - axis.low);

  class Answering {
    constructor(figure) {
      this.figure = figure;
      this.frame = figure.querySelector(".plot");
      this.svg = this.frame.querySelector("svg");
      this.plot = JSON.parse(figure.querySelector("script").textContent);
      this.section = figure.closest("section");
      this.overlay = drawn("g", { "pointer-events": "none" });
      this.svg.append(this.overlay);
      this.tip = make("div", { class: "tip", hidden: "" });
      this.frame.append(this.tip);
      this.step = 0;
      const { frame } = this;
      for (const [name, text] of Object.entries({ tabindex: 0, role: "slider", "aria-label": `values: ${figure.getAttribute("aria-label")}`,
        "aria-valuemin": 0, "aria-valuemax": 100, "aria-valuenow": 0, "aria-valuetext": "arrow keys read the plot" })) frame.setAttribute(name, text);
      for (const kind of ["pointermove", "pointerdown"]) frame.addEventListener(kind, (event) => this.point(event));
      frame.addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") this.clear(); });
      frame.addEventListener("focus", () => { if (frame.matches(":focus-visible")) this.go(this.step); });
      frame.addEventListener("blur", () => this.clear());
      frame.addEventListener("keydown", (event) => this.key(event));
    }

    get curves() { return this.plot.curves.filter((curve) => !hidden.has(String(curve.of))); }

    at(curve, i) {
      const [left, top, right, bottom] = this.plot.box;
      return [place(this.plot.x, curve.x[i], left, right), place(this.plot.y, curve.y[i], bottom, top)];
    }

    points() {
      return this.curves.flatMap((curve) => curve.x.map((x, i) => [curve, i]).filter(([, i]) => curve.x[i] !== null && curve.y[i] !== null));
    }

    point(event) {
      const box = this.svg.getBoundingClientRect();
      const view = this.svg.viewBox.baseVal;
      const x = ((event.clientX - box.left) * view.width) / box.width;
      const y = ((event.clientY - box.top) * view.height) / box.height;
      if (this.plot.timed) {
        const [left, , right] = this.plot.box;
        this.time(within(this.plot.x, Math.min(1, Math.max(0, (x - left) / (right - left)))));
      } else {
        let best = null;
        let least = Infinity;
        for (const point of this.points()) {
          const [px, py] = this.at(...point);
          const far = Math.hypot(px - x, py - y);
          if (far < least) [best, least] = [point, far];
        }
        this.tell(best);
      }
    }

    key(event) {
      const last = this.plot.timed ? 100 : this.points().length - 1;
      const jump = Math.max(1, Math.round(last / 10));
      const moves = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: jump, PageDown: -jump };
      if (event.key === "Escape") this.clear();
      else if (event.key === "Home") this.go(0);
      else if (event.key === "End") this.go(last);
      else if (event.key in moves) this.go(this.step + moves[event.key]);
      else return;
      event.preventDefault();
    }

    go(step) {
      const points = this.plot.timed ? null : this.points();
      const last = points ? points.length - 1 : 100;
      this.step = Math.min(Math.max(step, 0), last);
      this.frame.setAttribute("aria-valuemax", Math.max(last, 0));
      this.frame.setAttribute("aria-valuenow", this.step);
      if (points) this.tell(points[this.step] ?? null);
      else this.time(within(this.plot.x, this.step / 100));
    }

    time(t) {
      const lines = this.curves.map((curve) => [curve, nearest(curve.x, t)]).filter(([curve, i]) => i >= 0 && curve.y[i] !== null);
      const values = lines.sort(([a, i], [b, j]) => b.y[j] - a.y[i]).map(([curve, i]) => [curve, number(curve.y[i])]);
      scrub(this.section, t);
      this.say(`${this.plot.x.name}: ${number(t)}`, values, place(this.plot.x, t, this.plot.box[0], this.plot.box[2]));
    }

    tell(point) {
      this.overlay.replaceChildren();
      if (!point) return this.clear();
      const [curve, i] = point;
      const [x] = this.at(curve, i);
      this.dot(curve, i);
      const said = [[null, this.plot.x.name, number(curve.x[i])], [null, this.plot.y.name, number(curve.y[i])]];
      if (curve.t[i] != null) said.push([null, "time", number(curve.t[i])]);
      this.say(null, [[curve, ""], ...said.map(([, name, text]) => [name, text])], x);
    }

    say(title, lines, x) {
      const rows = lines.map(([of, text]) => {
        const name = typeof of === "string" ? of : of.label + (of.final ? ", final" : "");
        const row = make("div", {}, name, make("b", {}, text));
        if (typeof of !== "string" && of.of >= 0) row.prepend(mark(of.of));
        return row;
      });
      this.tip.replaceChildren(...(title ? [make("div", {}, title)] : []), ...rows);
      this.tip.hidden = false;
      const share = x / this.svg.viewBox.baseVal.width;
      this.tip.style.cssText = share < 0.5 ? `left:${100 * share + 4}%;top:8%` : `right:${104 - 100 * share}%;top:8%`;
      this.frame.setAttribute("aria-valuetext", [title, ...rows.map((row) => row.textContent)].filter(Boolean).join(", "));
    }

    clear() {
      this.tip.hidden = true;
      if (!this.plot.timed) this.overlay.replaceChildren();
      this.now(this.last);
    }

    dot(curve, i) {
      const [cx, cy] = this.at(curve, i);
      const [left, top, right, bottom] = this.plot.box;
      if (cx < left || cx > right || cy < top || cy > bottom) return;
      this.overlay.append(drawn("circle", { class: `dot of-${curve.of}`, cx, cy, r: 3.6, fill: colour(curve.of) }));
    }

    // The time that the section's slider stands at: a cursor, or a dot on each path.
    now(t) {
      if (t === undefined) return;
      this.last = t;
      this.overlay.replaceChildren();
      const [left, top, right, bottom] = this.plot.box;
      if (this.plot.timed) {
        const x = place(this.plot.x, t, left, right);
        if (x >= left - 0.5 && x <= right + 0.5) this.overlay.append(drawn("line", { class: "cursor", x1: x, x2: x, y1: top, y2: bottom }));
        for (const curve of this.curves) {
          const i = nearest(curve.x, t);
          if (i >= 0 && curve.y[i] !== null) this.dot(curve, i);
        }
      } else {
        for (const curve of this.curves) {
          const i = nearest(curve.t, t);
          if (i >= 0 && curve.x[i] !== null && curve.y[i] !== null) this.dot(curve, i);
        }
      }
    }

    get times() {
      return this.plot.timed ? this.plot.curves.map((curve) => curve.x) : this.plot.curves.map((curve) => curve.t);
    }
  }
  const colour = (k) => document.querySelector(`#look-${k} path:last-child`)?.getAttribute("fill") ?? "currentColor";
  const mark = (k) => {
    const svg = drawn("svg", { class: "mark", "aria-hidden": "true" });
    svg.append(drawn("use", { href: `#look-${k}` }));
    return svg;
  };
  const sliders = new Map();
  const scrub = (section, t) => sliders.get(section)?.(t);

  for (const section of all("section")) {
    const plots = all("figure:has(script)", section).map((figure) => new Answering(figure));
    const moving = plots.filter((plot) => plot.times.some((t) => t.length > 1));
    const last = Math.max(...moving.flatMap((plot) => plot.times.map((t) => t.at(-1) ?? 0)));
    const along = section.querySelector(".along");
    if (!along || !moving.length || !(last > 0)) continue;
    const unit = moving.find((plot) => plot.plot.timed)?.plot.x.name ?? "time, s";
    const slider = make("input", { type: "range", min: 0, max: last, step: last / 500, value: 0, "aria-label": `${unit} along the log` });
    const told = make("output", {}, "drag through time");
    let playing = 0;
    const to = (t) => {
      slider.value = t;
      told.textContent = unit.includes(", ") ? `${number(t)} ${unit.split(", ").at(-1)}` : `${unit} ${number(t)}`;
      slider.setAttribute("aria-valuetext", told.textContent);
      for (const plot of moving) plot.now(t);
    };
    const stop = () => { cancelAnimationFrame(playing); playing = 0; play.textContent = "Play"; };
    const play = button("Play", () => {
      if (playing) return stop();
      const from = slider.valueAsNumber >= last ? 0 : slider.valueAsNumber;
      const begun = performance.now();
      const next = (now) => {
        const t = from + (Math.max(0, now - begun) / 8000) * last;
        to(Math.min(t, last));
        if (t >= last) stop(); else playing = requestAnimationFrame(next);
      };
      play.textContent = "Stop";
      playing = requestAnimationFrame(next);
    });
    slider.addEventListener("input", () => { stop(); to(slider.valueAsNumber); });
    sliders.set(section, to);
    (along.querySelector(".key") ?? along.firstElementChild).after(make("div", { class: "time" }, play, slider, told));
  }
})();
