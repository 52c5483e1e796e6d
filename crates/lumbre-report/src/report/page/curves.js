// Chart with zoom: a drag selects a range, a double click resets it, a click on a curve lists its
// run.
function curves(data, showRuns) {
  if (!data.metrics.length) {
    document.getElementById("curves").hidden = true;
    return;
  }
  const box = document.getElementById("chart");
  const tip = document.getElementById("tip");
  const pick = (id) => document.getElementById(id);
  const svgNS = "http://www.w3.org/2000/svg";
  const hidden = new Set();
  let view = null;

  fill(pick("metric"), data.metrics.map((m) => m.shown));
  fill(pick("facet"), data.facets.map((f, i) => f || "all"));
  fill(pick("x"), ["render time (s)", "samples per pixel"]);
  const columns = data.metrics.map((m) => m.name);
  const preferred = ["relmse", "rmse", "mse"].find((name) => columns.includes(name));
  if (preferred) pick("metric").value = columns.indexOf(preferred);
  pick("facet").parentElement.hidden = data.facets.length < 2;

  data.series.forEach((s, i) => {
    const label = document.createElement("label");
    const check = document.createElement("input");
    check.type = "checkbox";
    check.checked = true;
    check.addEventListener("change", () => { check.checked ? hidden.delete(i) : hidden.add(i); draw(); });
    const sample = document.createElementNS(svgNS, "svg");
    sample.setAttribute("width", 30);
    sample.setAttribute("height", 10);
    sample.append(element("line", { x1: 0, y1: 5, x2: 30, y2: 5, stroke: s.colour, "stroke-width": 2, "stroke-dasharray": s.dash }));
    label.append(check, sample, s.full + (s.long ? " (" + s.long + ")" : ""));
    pick("legend").append(label);
  });

  function element(name, attributes) {
    const made = document.createElementNS(svgNS, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  }

  // Converts a metric value to the drawn value: the absolute value for signed metrics, the distance
  // from the best value for metrics such as SSIM.
  function drawnValue(metric, y) {
    if (y === null || y === undefined) return NaN;
    if (metric.magnitude) y = Math.abs(y);
    return metric.complement !== null ? metric.complement - y : y;
  }

  // Points of all runs of the selected facet whose series is not hidden.
  function lines() {
    const metric = data.metrics[pick("metric").value];
    const x = Number(pick("x").value) === 0 ? 1 : 0;
    const facet = Number(pick("facet").value);
    const found = [];
    for (const run of data.runs) {
      if (run.facet !== facet || hidden.has(run.series)) continue;
      const points = [];
      for (const row of run.rows) {
        const y = drawnValue(metric, row[2 + metric.index]);
        if (row[x] > 0 && Number.isFinite(y) && (!metric.log || y > 0)) points.push([row[x], y]);
      }
      if (points.length) found.push({ run, points });
    }
    return { metric, found };
  }

  // About six labelled values between two ends.
  function ticks(low, high, log) {
    const out = [];
    if (log) {
      const span = Math.log10(high / low);
      for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++) {
        for (const f of span > 4 ? [1] : span > 1.5 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 6, 8]) {
          const v = f * 10 ** e;
          if (v >= low && v <= high) out.push(v);
        }
      }
      return out;
    }
    const raw = (high - low) / 6;
    const base = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((f) => f * base).find((s) => s >= raw);
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) out.push(v);
    return out;
  }

  const text = (v) => Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(0) : String(+v.toPrecision(3));

  function draw() {
    box.querySelectorAll("svg").forEach((old) => old.remove());
    const width = box.clientWidth, height = 460, left = 64, right = 16, top = 14, bottom = 44;
    const { metric, found } = lines();
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, role: "img" });
    box.prepend(svg);
    const all = found.flatMap((l) => l.points);
    if (!all.length) {
      const none = element("text", { x: width / 2, y: height / 2, "text-anchor": "middle", fill: "var(--faint)" });
      none.textContent = "no measurements";
      svg.append(none);
      return;
    }
    const range = (values, log) => {
      let low = Math.min(...values), high = Math.max(...values);
      if (log) { const pad = Math.max((high / low) ** 0.04, 1.05); return [low / pad, high * pad]; }
      const pad = Math.max((high - low) * 0.05, Math.abs(high) * 0.01, 1e-9);
      return [low - pad, high + pad];
    };
    const [x0, x1] = view ? view.x : range(all.map((p) => p[0]), true);
    const [y0, y1] = view ? view.y : range(all.map((p) => p[1]), metric.log);
    const f = (v, log) => (log ? Math.log(v) : v);
    const X = (v) => left + ((f(v, true) - f(x0, true)) / (f(x1, true) - f(x0, true))) * (width - left - right);
    const Y = (v) => height - bottom - ((f(v, metric.log) - f(y0, metric.log)) / (f(y1, metric.log) - f(y0, metric.log))) * (height - top - bottom);
    // Labels that would touch the one before are left out, as on the screen of a phone.
    let free = 0;
    for (const v of ticks(x0, x1, true)) {
      svg.append(element("line", { x1: X(v), x2: X(v), y1: top, y2: height - bottom, stroke: "var(--line)" }));
      const half = 3.5 * text(v).length;
      if (X(v) - half < free) continue;
      free = X(v) + half + 6;
      const label = element("text", { x: X(v), y: height - bottom + 18, "text-anchor": "middle", "font-size": 12, fill: "var(--ink)" });
      label.textContent = text(v);
      svg.append(label);
    }
    for (const v of ticks(y0, y1, metric.log)) {
      svg.append(element("line", { x1: left, x2: width - right, y1: Y(v), y2: Y(v), stroke: "var(--line)" }));
      const label = element("text", { x: left - 8, y: Y(v) + 4, "text-anchor": "end", "font-size": 12, fill: "var(--ink)" });
      label.textContent = text(v);
      svg.append(label);
    }
    const clip = element("clipPath", { id: "inside" });
    clip.append(element("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom }));
    svg.append(clip);
    const inside = element("g", { "clip-path": "url(#inside)" });
    svg.append(inside);
    // Below the noise of the reference, curves measure the error of the reference.
    const floors = found.map((l) => [l.run.series, drawnValue(metric, l.run.floors[metric.index])]).filter((f) => metric.log && f[1] > 0);
    const floor = Math.max(...floors.map((f) => f[1])), shared = floors.every((f) => f[1] > floor * (1 - 1e-9));
    for (const [series, own] of shared ? [] : floors) if (own > y0) inside.append(element("line", {
      x1: left, x2: width - right, y1: Y(own), y2: Y(own), stroke: data.series[series].colour, "stroke-width": 1.2, "stroke-dasharray": "1.2 3.4", class: "floor",
    }));
    pick("floors").hidden = shared || !floors.length;
    if (shared && floor > y0) {
      const at = Math.max(Y(floor), top);
      inside.append(element("rect", { x: left, y: at, width: width - left - right, height: height - bottom - at, fill: "var(--line)", "fill-opacity": 0.55, class: "floor" }));
      inside.append(element("line", { x1: left, x2: width - right, y1: at, y2: at, stroke: "var(--faint)", "stroke-dasharray": "1.2 3.4" }));
      const label = element("text", { x: left + 6, y: Math.min(at + 15, height - bottom - 5), "font-size": 12, fill: "var(--faint)" });
      label.textContent = "noise of the reference";
      inside.append(label);
    }
    for (const { run, points } of found) {
      const s = data.series[run.series];
      inside.append(element("polyline", {
        points: points.map((p) => X(p[0]) + "," + Y(p[1])).join(" "), fill: "none", stroke: s.colour,
        "stroke-width": 1.6, "stroke-dasharray": s.dash, "stroke-linejoin": "round", "data-run": run.id,
      }));
      const end = points[points.length - 1];
      if (run.state === "done") inside.append(element("circle", { cx: X(end[0]), cy: Y(end[1]), r: 3.4, fill: s.colour, stroke: "var(--paper)" }));
    }
    svg.append(element("path", { d: `M${left},${top}V${height - bottom}H${width - right}`, fill: "none", stroke: "var(--faint)" }));
    const xName = element("text", { x: (left + width) / 2, y: height - 8, "text-anchor": "middle", "font-size": 13, fill: "var(--ink)" });
    xName.textContent = pick("x").selectedOptions[0].textContent + (Number(pick("x").value) === 0 ? data.clock : "");
    const yName = element("text", { x: left + 6, y: top + 12, "font-size": 13, fill: "var(--faint)" });
    yName.textContent = metric.shown + (metric.unit ? " (" + metric.unit + ")" : "");
    svg.append(xName, yName);
    interact(svg, found, { X, Y, left, right, top, bottom, width, height, x0, x1, y0, y1, log: metric.log });
  }

  // Adds zoom, tooltip and click handlers. `a` holds the geometry of the chart.
  function interact(svg, found, a) {
    const back = (p, low, high, log) => (log ? low * (high / low) ** p : low + p * (high - low));
    const at = (e) => {
      const r = svg.getBoundingClientRect();
      return [((e.clientX - r.left) / r.width) * a.width, ((e.clientY - r.top) / r.height) * a.height];
    };
    const value = ([px, py]) => [
      back((px - a.left) / (a.width - a.left - a.right), a.x0, a.x1, true),
      back((a.height - a.bottom - py) / (a.height - a.top - a.bottom), a.y0, a.y1, a.log),
    ];
    let from = null, frame = null;
    const nearest = (px, py) => {
      let best = null;
      for (const line of found) for (const p of line.points) {
        const d = Math.hypot(a.X(p[0]) - px, a.Y(p[1]) - py);
        if (d < 18 && (!best || d < best.d)) best = { d, line, p };
      }
      return best;
    };
    svg.addEventListener("pointerdown", (e) => { from = at(e); svg.setPointerCapture(e.pointerId); });
    svg.addEventListener("pointermove", (e) => {
      const [px, py] = at(e);
      if (from && Math.hypot(px - from[0], py - from[1]) > 6) {
        if (!frame) { frame = element("rect", { fill: "#0072b2", "fill-opacity": 0.1, stroke: "#0072b2" }); svg.append(frame); }
        frame.setAttribute("x", Math.min(px, from[0]));
        frame.setAttribute("y", Math.min(py, from[1]));
        frame.setAttribute("width", Math.abs(px - from[0]));
        frame.setAttribute("height", Math.abs(py - from[1]));
        return;
      }
      const hit = nearest(px, py);
      tip.style.display = hit ? "block" : "none";
      if (!hit) return;
      const run = hit.line.run;
      tip.textContent = `${data.series[run.series].full}, repeat ${run.repeat}\n${text(hit.p[0])} → ${hit.p[1].toPrecision(4)}`;
      tip.style.left = Math.min(px + 14, a.width - 190) + "px";
      tip.style.top = py + 10 + "px";
    });
    svg.addEventListener("pointerleave", () => { tip.style.display = "none"; });
    svg.addEventListener("pointerup", (e) => {
      const to = at(e), start = from;
      from = null;
      if (frame && start) {
        const [xa, ya] = value([Math.min(start[0], to[0]), Math.max(start[1], to[1])]);
        const [xb, yb] = value([Math.max(start[0], to[0]), Math.min(start[1], to[1])]);
        view = { x: [xa, xb], y: [ya, yb] };
        frame = null;
        draw();
      } else {
        const hit = nearest(to[0], to[1]);
        if (hit) showRuns([hit.line.run.id]);
      }
    });
    svg.addEventListener("dblclick", reset);
  }

  function reset() { view = null; draw(); }
  for (const id of ["metric", "facet", "x"]) pick(id).addEventListener("change", reset);
  pick("all").addEventListener("click", reset);
  window.addEventListener("resize", draw);
  draw();
}

function fill(select, names) {
  names.forEach((name, i) => select.append(new Option(name, i)));
}
