// Picture viewer: linear half floats, shown with a selectable exposure.
function viewer(data) {
  const section = document.getElementById("viewer");
  if (!data.views.length) { section.hidden = true; return; }
  const pick = (id) => document.getElementById(id);
  const stage = pick("stage"), readout = pick("readout"), slider = pick("slider");
  const [canvas, right] = stage.querySelectorAll("canvas");
  // `beside` is what is shown right of the slider, as index of an image and mode; `split` is the
  // slider's place as a share of the stage's width.
  const state = { view: 0, image: 1, mode: "picture", beside: null, split: 0.5, stops: 0, zoom: 0, x: 0, y: 0 };

  // Values of all half floats by their bits.
  const half = new Float32Array(65536);
  for (let i = 0; i < 65536; i++) {
    const sign = i & 0x8000 ? -1 : 1, exponent = (i >> 10) & 31, fraction = i & 1023;
    half[i] = exponent === 0 ? sign * fraction * 2 ** -24
      : exponent === 31 ? (fraction ? NaN : sign * Infinity) : sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
  }
  // Tone maps from radiance times exposure to 0..=1, as in Rust.
  const tones = {
    srgb: (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055),
    gamma: (v, gamma) => v ** (1 / gamma),
    reinhard: (v, gamma) => (v / (1 + v)) ** (1 / gamma),
  };
  function shader({ kind, gamma }) {
    const tone = tones[kind];
    return (v) => (v > 0 ? Math.round(255 * Math.min(tone(v, gamma), 1)) : 0);
  }

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  function pixels(image) {
    if (!image.values) {
      const raw = new Uint16Array(bytes(image.half).buffer);
      image.values = Float32Array.from(raw, (h) => half[h]);
    }
    return image.values;
  }
  function flips(image) {
    if (image.flip && !image.flipValues) image.flipValues = bytes(image.flip);
    return image.flipValues;
  }

  const MODES = [["picture", ""], ["difference", "|difference|"], ["flip", "FLIP"]];
  const current = () => data.views[state.view];
  const shown = () => current().images[state.image];

  // Draws an image of the current view at its size.
  function drawn(image, canvas, mode = state.mode) {
    const view = current(), truth = view.images[image.truth];
    const { width, height } = view;
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext("2d"), out = context.createImageData(width, height), to = out.data;
    const shade = shader(view.display);
    const a = pixels(image), r = pixels(truth), gain = 2 ** state.stops, f = flips(image);
    for (let i = 0, n = width * height; i < n; i++) {
      const j = 3 * i, k = 4 * i;
      if (mode === "flip") {
        const c = data.magma[f ? f[i] : 0];
        to[k] = c[0]; to[k + 1] = c[1]; to[k + 2] = c[2];
      } else for (let c = 0; c < 3; c++) {
        const v = mode === "difference" ? Math.abs(a[j + c] - r[j + c]) : a[j + c];
        to[k + c] = Number.isNaN(v) ? (c === 1 ? 255 : 0) : shade(v * gain);
      }
      to[k + 3] = 255;
    }
    context.putImageData(out, 0, 0);
    return canvas;
  }

  function paint() {
    drawn(shown(), canvas);
    right.hidden = slider.hidden = !state.beside;
    if (state.beside) drawn(current().images[state.beside[0]], right, state.beside[1]);
    pick("beside").value = state.beside ? state.beside.join(" ") : "";
    place();
    showCrops();
    for (const [i, button] of [...pick("names").children].entries()) button.setAttribute("aria-pressed", i === state.image);
    for (const button of pick("modes").children) button.setAttribute("aria-pressed", button.dataset.mode === state.mode);
    pick("exposure").value = state.stops;
    pick("stops").textContent = (state.stops > 0 ? "+" : "") + state.stops + " stops";
    showReadout();
  }

  // Shows facts of the picture and, if given, the values of the pixel `at`.
  function showReadout(at) {
    const image = shown(), numbers = image.metrics.map((m) => `${m[0]} ${m[1]}`).join("   ");
    let line = image.samples === null ? image.name + ": " + image.words
      : `${image.name}: ${image.samples} spp, ${image.render_s} s   ${numbers}`;
    if (at) {
      const j = 3 * (at[1] * current().width + at[0]), v = pixels(image), r = pixels(current().images[image.truth]);
      const three = (p) => [0, 1, 2].map((c) => p[j + c].toPrecision(4)).join(" ");
      line += `\n${at[0]}, ${at[1]}: ${three(v)}   reference ${three(r)}`;
    } else line += "\n ";
    readout.textContent = line;
  }

  function fit() {
    const { width, height } = current();
    state.zoom = Math.min(stage.clientWidth / width, stage.clientHeight / height);
    state.x = (stage.clientWidth - width * state.zoom) / 2;
    state.y = (stage.clientHeight - height * state.zoom) / 2;
  }
  function place() {
    const at = state.split * stage.clientWidth;
    for (const each of [canvas, right]) each.style.transform = `translate(${state.x}px,${state.y}px) scale(${state.zoom})`;
    right.style.clipPath = `inset(0 0 0 ${Math.max((at - state.x) / state.zoom, 0)}px)`;
    slider.style.left = at + "px";
    for (const frame of stage.querySelectorAll(".window")) {
      const [x, y, w, h] = frame.crop;
      frame.style.left = state.x + x * state.zoom + "px";
      frame.style.top = state.y + y * state.zoom + "px";
      frame.style.width = w * state.zoom + "px";
      frame.style.height = h * state.zoom + "px";
    }
  }

  // Windows of crops in pixels of the view: left, top, width, height.
  const MOST_CROPS = 4;
  let crops = [], cropping = false;
  function frames(list) {
    for (const frame of stage.querySelectorAll(".window")) frame.remove();
    for (const crop of list) {
      const frame = document.createElement("div");
      frame.className = "window";
      frame.crop = crop;
      stage.append(frame);
    }
    place();
  }
  function showCrops() {
    frames(crops);
    pick("crops").hidden = !crops.length;
    const full = current().shrunk;
    pick("command").textContent = data.command + crops.map((c) => " --crop " + c.map((v) => v * full).join(",")).join("");
    if (!crops.length) return;
    const buffer = document.createElement("canvas");
    pick("cropped").replaceChildren(...crops.flatMap((crop) => current().images.map((image) => {
      drawn(image, buffer);
      const part = document.createElement("canvas"), [x, y, w, h] = crop;
      part.width = w;
      part.height = h;
      part.getContext("2d").drawImage(buffer, x, y, w, h, 0, 0, w, h);
      const figure = document.createElement("figure"), caption = document.createElement("figcaption");
      caption.textContent = image.name;
      figure.append(part, caption);
      return figure;
    })));
  }
  function setCropping(on) {
    cropping = on;
    stage.classList.toggle("cropping", on);
    pick("crop").setAttribute("aria-pressed", on);
  }
  // The window between two points of the stage, inside of the picture; null if it is a click.
  function between(from, to) {
    const { width, height } = current();
    const side = (a, b, offset, most) => {
      const ends = [a, b].map((v) => Math.min(Math.max((v - offset) / state.zoom, 0), most)).sort((p, q) => p - q);
      return [Math.floor(ends[0]), Math.ceil(ends[1]) - Math.floor(ends[0])];
    };
    const [x, w] = side(from[0], to[0], state.x, width), [y, h] = side(from[1], to[1], state.y, height);
    return w > 1 && h > 1 ? [x, y, w, h] : null;
  }

  function choose(index) {
    state.view = index;
    const view = current();
    crops = [];
    state.image = Math.min(state.image, view.images.length - 1);
    state.beside = null;
    const beside = view.images.flatMap((image, i) => MODES.filter(([mode]) => mode === "picture" || image.truth !== i)
      .map(([mode, words]) => new Option(words ? `${image.name}, ${words}` : image.name, i + " " + mode)));
    pick("beside").replaceChildren(new Option("nothing", ""), ...beside);
    state.stops = view.display.exposure;
    pick("names").replaceChildren(...view.images.map((image, i) => {
      const button = document.createElement("button");
      const key = document.createElement("span");
      key.textContent = i;
      button.append(key, image.name);
      button.addEventListener("click", () => { state.image = i; paint(); });
      return button;
    }));
    pick("smaller").textContent = view.shrunk > 1 ? `Reduced to 1/${view.shrunk} of its width. The files of the report have the full resolution.` : "";
    fit();
    paint();
  }

  fill(pick("scene"), data.views.map((v) => v.name || "all"));
  pick("scene").parentElement.hidden = data.views.length < 2;
  pick("scene").addEventListener("change", () => choose(Number(pick("scene").value)));
  for (const button of pick("modes").children) button.addEventListener("click", () => { state.mode = button.dataset.mode; paint(); });
  pick("beside").addEventListener("change", () => {
    const [image, mode] = pick("beside").value.split(" ");
    state.beside = mode ? [Number(image), mode] : null;
    paint();
  });
  pick("exposure").addEventListener("input", () => { state.stops = Number(pick("exposure").value); paint(); });
  pick("fit").addEventListener("click", () => { fit(); place(); });
  pick("crop").addEventListener("click", () => setCropping(!cropping));
  pick("nocrops").addEventListener("click", () => { crops = []; showCrops(); });
  pick("copycrop").addEventListener("click", () => navigator.clipboard.writeText(pick("command").textContent));

  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || ["INPUT", "SELECT", "TEXTAREA"].includes(e.target.tagName)) return;
    const number = e.key >= "0" && e.key <= "9" ? Number(e.key) : -1;
    if (number >= 0 && number < current().images.length) state.image = number;
    else if (e.key === "+" || e.key === "=") state.stops += 0.5;
    else if (e.key === "-") state.stops -= 0.5;
    else if (e.key === "p") state.mode = "picture";
    else if (e.key === "d") state.mode = "difference";
    else if (e.key === "f") state.mode = "flip";
    else if (e.key === "c") { setCropping(!cropping); return; }
    else if (e.key === "s") state.beside = state.beside ? null : [(state.image + 1) % current().images.length, "picture"];
    else return;
    paint();
  });

  const spot = (e) => {
    const r = stage.getBoundingClientRect();
    return [e.clientX - r.left, e.clientY - r.top];
  };
  let drag = null, corner = null, sliding = false;
  stage.addEventListener("wheel", (e) => {
    e.preventDefault();
    const [px, py] = spot(e), factor = Math.exp(-e.deltaY * 0.0015);
    const zoom = Math.min(Math.max(state.zoom * factor, 0.1), 64);
    state.x = px - ((px - state.x) * zoom) / state.zoom;
    state.y = py - ((py - state.y) * zoom) / state.zoom;
    state.zoom = zoom;
    place();
  }, { passive: false });
  stage.addEventListener("pointerdown", (e) => {
    if (e.target === slider) sliding = true;
    else if (cropping || e.shiftKey) corner = spot(e);
    else drag = [...spot(e), state.x, state.y];
    stage.setPointerCapture(e.pointerId);
  });
  stage.addEventListener("pointerup", (e) => {
    const crop = corner && between(corner, spot(e));
    if (crop) crops = [...crops, crop].slice(-MOST_CROPS);
    if (corner) showCrops();
    drag = corner = null;
    sliding = false;
  });
  stage.addEventListener("pointermove", (e) => {
    const [px, py] = spot(e);
    if (sliding) {
      state.split = Math.min(Math.max(px / stage.clientWidth, 0), 1);
      place();
      return;
    }
    if (corner) {
      const crop = between(corner, [px, py]);
      frames(crop ? [...crops, crop] : crops);
      return;
    }
    if (drag) {
      state.x = drag[2] + px - drag[0];
      state.y = drag[3] + py - drag[1];
      place();
      return;
    }
    const at = [Math.floor((px - state.x) / state.zoom), Math.floor((py - state.y) / state.zoom)];
    const { width, height } = current();
    showReadout(at[0] >= 0 && at[1] >= 0 && at[0] < width && at[1] < height ? at : null);
  });
  for (const link of document.querySelectorAll("a[data-view]")) {
    link.addEventListener("click", () => { pick("scene").value = link.dataset.view; choose(Number(link.dataset.view)); });
  }
  choose(0);
}
