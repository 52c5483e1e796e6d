// Copies a text, or shows it where a page may not copy.
function copy(button, text) {
  const name = button.textContent;
  const done = () => { button.textContent = "copied"; setTimeout(() => { button.textContent = name; }, 1200); };
  const ask = () => window.prompt(name, text);
  navigator.clipboard ? navigator.clipboard.writeText(text).then(done, ask) : ask();
}

// Opens the folded section of the item that the address names.
function unfold() {
  const item = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const section = item && item.closest("details");
  if (!section || section.open) return;
  section.open = true;
  item.scrollIntoView();
}

// Table of runs. It can be sorted by any column, and filtered by words or by a click on a number
// or curve.
function runs(data) {
  const table = document.getElementById("runs"), words = document.getElementById("words");
  const columns = [
    ...data.axes.map((name, i) => ({ name, get: (r) => r.axes[i], numeric: data.runs.every((r) => r.axes[i] === "" || !Number.isNaN(Number(r.axes[i]))) })),
    ...(data.nights.length > 1 ? [{ name: "night", get: (r) => data.nights[r.night].name }] : []),
    { name: "repeat", get: (r) => r.repeat, numeric: true },
    { name: "state", get: (r) => r.state },
    { name: "spp", get: (r) => r.samples, numeric: true },
    { name: "render (s)", get: (r) => r.render_s, numeric: true },
    { name: "samples/s", get: (r) => r.rate, numeric: true },
    ...data.metrics.map((m, i) => ({ name: m.column, get: (r) => r.last[i], numeric: true })),
    { name: "run", get: (r) => r.id },
    { name: "render again", get: (r) => r.command },
  ];
  let sorted = -1, down = false, only = null;

  const head = table.createTHead().insertRow();
  columns.forEach((column, i) => {
    const th = document.createElement("th");
    th.textContent = column.name;
    th.className = column.numeric ? "n" : "";
    th.tabIndex = 0;
    const sort = () => { down = sorted === i ? !down : false; sorted = i; draw(); };
    th.addEventListener("click", sort);
    th.addEventListener("keydown", (e) => { if (e.key === "Enter") sort(); });
    head.append(th);
  });
  const body = table.createTBody();
  const number = (v) => (v === null || v === undefined || v === "" ? "–" : typeof v === "number" ? String(+v.toPrecision(5)) : v);

  function draw() {
    const asked = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let list = data.runs.filter((r) => !only || only.has(r.id));
    list = list.filter((r) => {
      const text = columns.map((c) => c.name + "=" + c.get(r)).join(" ").toLowerCase();
      return asked.every((word) => text.includes(word));
    });
    if (sorted >= 0) {
      const { get, numeric } = columns[sorted];
      const missing = (v) => v === null || v === undefined || v === "";
      list.sort((a, b) => {
        const [x, y] = [get(a), get(b)];
        if (missing(x) || missing(y)) return missing(x) - missing(y);
        return (numeric ? x - y : String(x).localeCompare(String(y))) * (down ? -1 : 1);
      });
    }
    [...head.children].forEach((th, i) => th.setAttribute("aria-sort", i === sorted ? (down ? "descending" : "ascending") : "none"));
    body.replaceChildren(...list.map((r) => {
      const row = document.createElement("tr");
      row.id = "run-" + r.id;
      for (const column of columns) {
        const cell = row.insertCell();
        const value = column.get(r);
        if (column.name === "run") {
          const link = document.createElement("a");
          link.href = r.link;
          link.textContent = r.id.slice(0, 8);
          link.title = "folder of the run";
          cell.append(link);
        } else if (column.name === "render again") {
          const button = document.createElement("button");
          button.textContent = "copy command";
          button.title = value;
          button.addEventListener("click", () => copy(button, value));
          cell.append(button);
        } else {
          cell.textContent = column.numeric ? number(value) : value;
          if (column.numeric) cell.className = "n";
        }
      }
      return row;
    }));
    document.getElementById("count").textContent = `${list.length} of ${data.runs.length} runs`;
    document.getElementById("every").hidden = !only;
  }

  function show(ids) {
    only = new Set(ids);
    draw();
    document.getElementById("run-table").scrollIntoView();
  }
  words.addEventListener("input", draw);
  document.getElementById("every").addEventListener("click", () => { only = null; draw(); });
  for (const link of document.querySelectorAll("a[data-runs]")) {
    link.addEventListener("click", (e) => { e.preventDefault(); show(link.dataset.runs.split(" ").map((i) => data.runs[i].id)); });
  }
  draw();
  return show;
}

for (const button of document.querySelectorAll("button.copy")) {
  button.addEventListener("click", () => copy(button, button.dataset.text));
}
window.addEventListener("hashchange", unfold);
unfold();
const data = JSON.parse(document.getElementById("data").textContent);
const showRuns = runs(data);
curves(data, showRuns);
viewer(data);
document.documentElement.dataset.ready = "yes";

// A served page asks for a newer one while it is not used. If there is none, the server's answer
// without content keeps this one.
if (data.live !== null) {
  let used = 0;
  for (const kind of ["pointerdown", "pointermove", "keydown", "wheel"]) addEventListener(kind, () => { used = Date.now(); });
  if (sessionStorage.top) scrollTo({ top: Number(sessionStorage.top), behavior: "instant" });
  setInterval(() => {
    if (Date.now() - used < 10000) return;
    sessionStorage.top = scrollY;
    location.replace("?after=" + data.live);
  }, 5000);
}
