"use strict";
(() => {
  const run = JSON.parse(document.getElementById("run").textContent);
  const $ = (id) => document.getElementById(id);
  const slider = $("frame"), play = $("play"), speed = $("speed"), now = $("now"), cursor = $("cursor"), chart = $("errors");
  const last = run.when.length - 1;
  const SECONDS = 20; // of the whole run at 1×

  // A path as one text, and how much of it lies behind each of its points: a frame shows a slice.
  function drawn(pairs) {
    let d = "", pen = "M";
    const until = [0];
    for (let k = 0; k < pairs.length; k += 2) {
      if (pairs[k] === null) pen = "M";
      else { d += pen + pairs[k] + " " + pairs[k + 1]; pen = "L"; }
      until.push(d.length);
    }
    return (points) => d.slice(0, until[Math.min(points, until.length - 1)]);
  }

  // The map of every frame; what has not changed is shared with the frame before.
  function grown(maps) {
    let marks = [];
    return maps.map(([gone, changed]) => {
      if (gone.length || changed.length) marks = marks.slice();
      for (const slot of gone) marks[slot] = null;
      for (let k = 0; k < changed.length; k += 6) marks[changed[k]] = changed.slice(k + 1, k + 6);
      return marks;
    });
  }

  function ring(u, v, a, b, degree) {
    if (!a) return "";
    const x = a * Math.cos(degree * Math.PI / 180), y = a * Math.sin(degree * Math.PI / 180);
    const arc = "A" + a + " " + b + " " + degree + " 1 0 ";
    const from = (u - x).toFixed(0) + " " + (v - y).toFixed(0), to = (u + x).toFixed(0) + " " + (v + y).toFixed(0);
    return "M" + from + arc + to + arc + from;
  }

  function robot(u, v, degree, stopped) {
    if (stopped) return "M" + (u - 16) + " " + (v - 16) + "l32 32m-32 0l32 -32";
    const corners = [[28, 0], [20, 2.5], [8, Math.PI], [20, -2.5]].map(([reach, turn]) => {
      const angle = degree * Math.PI / 180 + turn;
      return (u + reach * Math.cos(angle)).toFixed(0) + " " + (v + reach * Math.sin(angle)).toFixed(0);
    });
    return "M" + corners.join("L") + "Z";
  }

{% if view.fixed %}
  // Marks of all positions, and how much of them lies before each frame's end; the newest one's ellipse at each.
  const positions = { d: "", until: [], shape: [] };
  for (const one of run.positions) {
    const [u, v, ...shape] = one, m = {{ mark }};
    let newest = positions.shape.at(-1) || "";
    if (one.length) {
      newest = u === null || v === null ? "" : ring(u, v, ...shape);
      if (v === null) positions.d += "M" + u + " 0V9999";
      else if (u === null) positions.d += "M0 " + v + "H1000";
      else positions.d += "M" + u + " " + (v - m) + "l" + m + " " + m + "l-" + m + " " + m + "l-" + m + " -" + m + "z";
    }
    positions.until.push(positions.d.length);
    positions.shape.push(newest);
  }
{% endif %}
{% if view.pointed %}
  function needle(u, v, degree) {
    const end = (reach, turned) => [reach * Math.cos(turned * Math.PI / 180), reach * Math.sin(turned * Math.PI / 180)];
    const [x, y] = end({{ needle }}, degree), tip = (u + x).toFixed(0) + " " + (v + y).toFixed(0);
    const [one, other] = [150, -150].map((turn) => {
      const [a, b] = end(22, degree + turn);
      return tip + "L" + (u + x + a).toFixed(0) + " " + (v + y + b).toFixed(0);
    });
    return "M" + u + " " + v + "L" + one + "M" + other;
  }
{% endif %}

  const truth = drawn(run.truth), reckoned = drawn(run.reckoned);
  const panels = [...document.querySelectorAll(".run")].map((figure, k) => {
    const told = run.panels[k], parts = {};
    for (const path of figure.querySelectorAll("path")) parts[path.getAttribute("class")] = path;
{% if view.cells %}
    parts.images = [...figure.querySelectorAll("image")];
{% endif %}
    return { ...told, parts, words: figure.querySelector(".said"), line: drawn(told.trail), marks: grown(told.maps) };
  });

  function show(frame) {
    const at = run.at[frame], known = truth(at), alone = reckoned(at);
    const u = run.robot[2 * frame], there = u === null ? "" : "M" + u + " " + run.robot[2 * frame + 1] + "h0";
    for (const panel of panels) {
      const set = (name, d) => panel.parts[name].setAttribute("d", d);
      const k = Math.min(frame, panel.pose.length - 1);
      set("known", known);
      set("reckoned", alone);
      set("true", there);
{% if view.fixed %}
      set("positions", positions.d.slice(0, positions.until[frame]));
      set("position", positions.shape[frame]);
{% endif %}
      panel.words.textContent = panel.said[Math.min(frame, panel.said.length - 1)];
      if (k < 0) continue;
{% if view.cells %}
      const grid = panel.grids.findLastIndex((from) => from <= frame);
      panel.parts.images.forEach((image, j) => { image.style.display = j === grid ? "" : "none"; });
      let hits = "";
      for (let j = 0; j < panel.hits[k].length && frame <= k; j += 2) hits += "M" + panel.hits[k][j] + " " + panel.hits[k][j + 1] + "h0";
      set("hits", hits);
{% endif %}
      const stopped = frame > k, marks = panel.marks[k].filter(Boolean), seen = panel.seen[k], [x, y, degree] = panel.pose[k];
      let rays = "";
      for (let j = 2; j < seen.length && !stopped; j += 2) rays += "M" + seen[0] + " " + seen[1] + "L" + seen[j] + " " + seen[j + 1];
{% if view.rings %}
      for (const r of stopped ? [] : panel.rings[k]) rays += ring(seen[0], seen[1], r, r, 0);
{% endif %}
      set("trail", panel.line(at));
      set("marks", marks.map((mark) => ring(...mark)).join(""));
      set("dots", marks.map((mark) => "M" + mark[0] + " " + mark[1] + "h0").join(""));
      set("rays", rays);
{% if view.open %}
      set("open", drawn(panel.open[k])(Infinity));
{% endif %}
{% if view.pointed %}
      set("pointed", stopped || !panel.pointed[k].length ? "" : needle(...panel.pointed[k]));
{% endif %}
      set("belief", stopped ? "" : ring(x, y, ...panel.belief[k]));
      set("robot", robot(x, y, degree, stopped));
    }
    now.textContent = run.when[frame];
    slider.value = frame;
    slider.setAttribute("aria-valuetext", run.when[frame]);
    if (cursor) cursor.setAttribute("d", "M" + (1000 * frame / last) + " 0V150");
  }

  let playing = false, place = last, before = 0;
  function go(frame) {
    place = Math.min(Math.max(frame, 0), last);
    show(Math.floor(place));
  }
  function tick(time) {
    if (!playing) return;
    go(place + (time - before) / 1000 * speed.value * last / SECONDS);
    before = time;
    if (place >= last) pause();
    else requestAnimationFrame(tick);
  }
  function pause() {
    playing = false;
    play.textContent = "Play";
  }
  function start() {
    if (place >= last) place = 0;
    playing = true;
    play.textContent = "Pause";
    before = performance.now();
    requestAnimationFrame(tick);
  }
  function faster(by) {
    speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + by, 0), speed.options.length - 1);
  }

  play.addEventListener("click", () => (playing ? pause() : start()));
  slider.addEventListener("input", () => { pause(); go(Number(slider.value)); });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target === speed) return;
    const far = event.shiftKey ? 10 : 1, here = Math.floor(place);
    const keys = {
      ArrowLeft: () => { pause(); go(here - far); },
      ArrowRight: () => { pause(); go(here + far); },
      Home: () => { pause(); go(0); },
      End: () => { pause(); go(last); },
      "+": () => faster(1),
      "-": () => faster(-1),
      " ": () => (playing ? pause() : start()),
    };
    if (!(event.key in keys) || (event.key === " " && event.target === play)) return;
    event.preventDefault();
    keys[event.key]();
  });
  if (chart) {
    const seek = (event) => {
      const box = chart.getBoundingClientRect();
      pause();
      go(Math.round(last * (event.clientX - box.left) / box.width));
    };
    chart.addEventListener("pointerdown", (event) => { chart.setPointerCapture(event.pointerId); seek(event); });
    chart.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
  }
  for (const part of document.querySelectorAll(".player, .keys")) part.hidden = false;
  show(last);
})();
