// Presses keys and buttons of a report's page and stores the results in `data-probe` of the document, for report.rs.
const press = (key) => document.dispatchEvent(new KeyboardEvent("keydown", { key }));
const names = [...document.querySelectorAll("#names button")];
const pixel = () => { const c = document.querySelector("#stage canvas"); return c.getContext("2d").getImageData(0, 0, c.width, c.height).data.join(); };
press("0"); const truth = pixel();
press("2"); const second = pixel();
const pressed = names.findIndex((b) => b.getAttribute("aria-pressed") === "true");
press("d"); const difference = pixel(); press("0"); const none = pixel(); press("2");
press("f"); const flip = pixel(); press("p"); press("+"); const brighter = pixel();
// The slider: the next picture right of it, at the same zoom; then its error map beside it.
press("-"); press("1"); press("s");
const right = document.querySelectorAll("#stage canvas")[1];
const beside = !right.hidden && right.style.transform === document.querySelector("#stage canvas").style.transform
  && right.getContext("2d").getImageData(0, 0, right.width, right.height).data.join() === second;
const choice = document.getElementById("beside");
choice.value = "2 flip"; choice.dispatchEvent(new Event("change"));
const besides = beside && right.getContext("2d").getImageData(0, 0, right.width, right.height).data.join() === flip;
press("s"); const apart = right.hidden; press("2"); press("+");
const zero = none.split(",").every((v, i) => (i % 4 === 3 ? v === "255" : v === "0"));
const header = [...document.querySelectorAll("#runs th")].find((th) => th.textContent === "rmse");
header.click(); const place = [...header.parentElement.children].indexOf(header);
const column = () => [...document.querySelectorAll("#runs tbody tr")].map((r) => Number(r.cells[place].textContent));
const up = column(); header.click(); const down = column();
document.querySelector("a[data-runs]").click();
const narrowed = document.querySelectorAll("#runs tbody tr").length;
document.documentElement.dataset.probe = JSON.stringify({
  names: names.length, pressed, differs: new Set([truth, second, difference, flip, brighter]).size, zero,
  sorted: up.every((v, i) => !i || up[i - 1] <= v) && down.every((v, i) => !i || down[i - 1] >= v), rows: up.length,
  narrowed, slider: besides && apart, curves: document.querySelectorAll("#chart polyline").length,
});
